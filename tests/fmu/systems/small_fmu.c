/* A small FMU for tests, FMI 2.0 and 3.0: N variables with STARTS, outputs by DERIVE, a step by ADVANCE.
 * These four are defined before this file is included. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
typedef struct { double v[N]; double t; int started; void *env; void (*log)(); } I;
static const double start[N] = { STARTS };
static void derive(double *v, double t) { (void)v; (void)t; DERIVE }
static int advance(double *v, double t, double h) { (void)v; (void)t; (void)h; ADVANCE return 0; }
static I *make(void) { I *m = calloc(1, sizeof(I)); memcpy(m->v, start, sizeof start); derive(m->v, 0); return m; }
static int get(I *m, const unsigned *r, size_t n, double *x) {
    derive(m->v, m->t);
    for (size_t k = 0; k < n; k++) { if (r[k] >= N) return 3; x[k] = m->v[r[k]]; }
    return 0;
}
static int set(I *m, const unsigned *r, size_t n, const double *x) {
    for (size_t k = 0; k < n; k++) { if (r[k] >= N) return 3; m->v[r[k]] = x[k]; }
    return 0;
}
static int save(I *m, void **s) { if (!*s) *s = malloc(sizeof(I)); memcpy(*s, m, sizeof(I)); return 0; }
static int restore(I *m, void *s) { memcpy(m, s, sizeof(I)); return 0; }
static int drop(void **s) { free(*s); *s = NULL; return 0; }
static int step(I *m, double t, double h) {
    if (fabs(t - m->t) > 1e-9) return 3;
    int status = advance(m->v, t, h);
    m->t = t + h;
    derive(m->v, m->t);
    return status;
}
typedef struct { void (*logger)(void *, const char *, int, const char *, const char *, ...); void *(*a)(size_t, size_t);
    void (*f)(void *); void (*s)(void *, int); void *env; } callbacks;
typedef void (*logger3)(void *, int, const char *, const char *);
static void say2(I *m, const char *text) { callbacks *c = (callbacks *)m->log; c->logger(c->env, "m", 3, "logStatusError", "%s", text); }
void *fmi2Instantiate(const char *n, int type, const char *guid, const char *where, callbacks *c, int visible, int on) {
    I *m = make(); m->log = (void (*)())c; m->env = NULL; return m; }
void fmi2FreeInstance(I *m) { free(m); }
int fmi2SetupExperiment(I *m, int td, double tol, double begin, int sd, double stop) { m->t = begin; return 0; }
int fmi2EnterInitializationMode(I *m) { return 0; }
int fmi2ExitInitializationMode(I *m) { return 0; }
int fmi2Terminate(I *m) { return 0; }
int fmi2SetDebugLogging(I *m, int on, size_t n, const char *const *c) { return 0; }
int fmi2GetReal(I *m, const unsigned *r, size_t n, double *x) { return get(m, r, n, x); }
int fmi2SetReal(I *m, const unsigned *r, size_t n, const double *x) { return set(m, r, n, x); }
int fmi2GetInteger(I *m, const unsigned *r, size_t n, int *x) { for (size_t k = 0; k < n; k++) x[k] = (int)m->v[r[k]]; return 0; }
int fmi2SetInteger(I *m, const unsigned *r, size_t n, const int *x) { for (size_t k = 0; k < n; k++) m->v[r[k]] = x[k]; return 0; }
int fmi2DoStep(I *m, double t, double h, int no) { int s = step(m, t, h); if (s > 1) say2(m, "the spring broke"); return s; }
int fmi2GetFMUstate(I *m, void **s) { return save(m, s); }
int fmi2SetFMUstate(I *m, void *s) { return restore(m, s); }
int fmi2FreeFMUstate(I *m, void **s) { return drop(s); }
void *fmi3InstantiateCoSimulation(const char *n, const char *token, const char *where, _Bool visible, _Bool on, _Bool events,
    _Bool early, const unsigned *r, size_t nr, void *env, logger3 log, void *update) {
    I *m = make(); m->env = env; m->log = (void (*)())log; return m; }
void fmi3FreeInstance(I *m) { free(m); }
int fmi3EnterInitializationMode(I *m, _Bool td, double tol, double begin, _Bool sd, double stop) { m->t = begin; return 0; }
int fmi3ExitInitializationMode(I *m) { return 0; }
int fmi3Terminate(I *m) { return 0; }
int fmi3SetDebugLogging(I *m, _Bool on, size_t n, const char *const *c) { return 0; }
int fmi3GetFloat64(I *m, const unsigned *r, size_t n, double *x, size_t nx) { return get(m, r, n, x); }
int fmi3SetFloat64(I *m, const unsigned *r, size_t n, const double *x, size_t nx) { return set(m, r, n, x); }
int fmi3GetInt32(I *m, const unsigned *r, size_t n, int32_t *x, size_t nx) { return fmi2GetInteger(m, r, n, x); }
int fmi3SetInt32(I *m, const unsigned *r, size_t n, const int32_t *x, size_t nx) { return fmi2SetInteger(m, r, n, x); }
int fmi3DoStep(I *m, double t, double h, _Bool no, _Bool *event, _Bool *end, _Bool *early, double *last) {
    *event = *end = *early = 0; *last = t + h; int s = step(m, t, h);
    if (s > 1) ((logger3)m->log)(m->env, 3, "logStatusError", "the spring broke");
    return s; }
int fmi3GetFMUState(I *m, void **s) { return save(m, s); }
int fmi3SetFMUState(I *m, void *s) { return restore(m, s); }
int fmi3FreeFMUState(I *m, void **s) { return drop(s); }
