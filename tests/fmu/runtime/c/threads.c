/* Instances in threads of their own against the same ones after one another: threads VERSION. */
#include "driver.h"

#include <pthread.h>

enum { INSTANCES = 8, STEPS = 60, SHOWN = GT_VARIABLES };

typedef struct {
    int version, number, status;
    double seen[STEPS + 1][SHOWN];
} job;


static void quiet_2(void *e, const char *n, fmi2Status s, const char *c, const char *f, ...) { (void)e, (void)n, (void)s, (void)c, (void)f; }
static void quiet_3(void *e, fmi3Status s, const char *c, const char *m) { (void)e, (void)s, (void)c, (void)m; }

static int look(void *c, int version, double *to) {
    unsigned i;
    int status = 0;
    for (i = 0; i < SHOWN && !status; i++)
        if (gt_variables[i].kind != GT_MODE) status = get_real(c, version, i, to + i);
    return status;
}

/* Inputs differ from instance to instance and from step to step (the parallelogram falls flat after 75); every fifth step is taken twice from a saved state. */
static void *work(void *argument) {
    job *it = argument;
    static const fmi2CallbackFunctions quiet = {quiet_2, allocate, free, NULL, NULL};
    const int version = it->version;
    const unsigned input = first_of(GT_INPUT);
    void *saved = NULL, *c = version == 2 ? fmi2Instantiate("one", fmi2CoSimulation, GT_TOKEN, "", &quiet, 0, it->number % 2)
                                          : fmi3InstantiateCoSimulation("one", GT_TOKEN, "", false, it->number % 2, false, false, NULL, 0, NULL, quiet_3, NULL);
    int k, status = !c;
    if (!status) status = enter(c, version, 0) || leave(c, version) || look(c, version, it->seen[0]);
    for (k = 0; k < STEPS && !status; k++) {
        if (input < GT_VARIABLES) status = set_real(c, version, input, 0.3 * it->number + 0.2 * (k % 7));
        if (k % 5 == 0 && !status) {
            status = version == 2 ? (int)fmi2GetFMUstate(c, &saved) : (int)fmi3GetFMUState(c, &saved);
            status = status || step(c, version, 0.004 * k, 0.004);
            status = status || (version == 2 ? (int)fmi2SetFMUstate(c, saved) : (int)fmi3SetFMUState(c, saved));
        }
        status = status || step(c, version, 0.004 * k, 0.004) || look(c, version, it->seen[k + 1]);
    }
    if (c) {
        if (version == 2) fmi2FreeFMUstate(c, &saved);
        else fmi3FreeFMUState(c, &saved);
        release(c, version);
    }
    it->status = status;
    return NULL;
}

int main(int count, char **words) {
    job *together = calloc(INSTANCES, sizeof *together), *apart = calloc(INSTANCES, sizeof *apart);
    pthread_t threads[INSTANCES];
    int i, bad = count != 2, version = count == 2 ? atoi(words[1]) : 0;
    for (i = 0; i < INSTANCES; i++) {
        together[i].version = apart[i].version = version;
        together[i].number = apart[i].number = i;
        bad |= pthread_create(threads + i, NULL, work, together + i);
    }
    for (i = 0; i < INSTANCES; i++) bad |= pthread_join(threads[i], NULL);
    for (i = 0; i < INSTANCES; i++) {
        work(apart + i);
        bad |= together[i].status || apart[i].status || memcmp(together[i].seen, apart[i].seen, sizeof apart[i].seen);
        if (bad) fprintf(stderr, "instance %d differs, or failed: %d, %d\n", i, together[i].status, apart[i].status);
    }
    if (GT_INPUTS && !memcmp(apart[0].seen[STEPS], apart[1].seen[STEPS], sizeof apart[0].seen[STEPS])) bad = 1; /* inputs act */
    free(together);
    free(apart);
    return bad;
}
