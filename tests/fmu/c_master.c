/* The smallest master of one FMU: how many steps of 4 ms it makes in a second, through FMI 3.0 Co-Simulation.
 *
 * c_master LIBRARY TOKEN STEPS AMPLITUDE INPUT,INPUT,... OUTPUT,OUTPUT,...
 *
 * Sets the inputs (value references) to forces that change at every step, steps, gets the outputs; after every
 * second of simulated time it goes back to the saved start. Prints the wall time in s and the outputs after the
 * last step. The force of input i = 1, 2, ... is AMPLITUDE sin(2 pi i t).
 */
#define _POSIX_C_SOURCE 200809L
#include <dlfcn.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define STEP 0.004
#define STEPS_OF_A_SECOND 250
#define MOST 64

typedef void *instance;
typedef uint32_t reference;

typedef instance (*instantiate)(const char *name, const char *token, const char *resources, _Bool visible,
                                _Bool logging, _Bool event_mode, _Bool early_return, const reference *intermediate,
                                size_t count, void *environment, void (*log)(void *, int, const char *, const char *),
                                void *update);
typedef int (*enter)(instance, _Bool tolerance_defined, double tolerance, double start, _Bool stop_defined, double stop);
typedef int (*plain)(instance);
typedef int (*set)(instance, const reference *, size_t, const double *, size_t);
typedef int (*get)(instance, const reference *, size_t, double *, size_t);
typedef int (*step)(instance, double time, double size, _Bool no_return, _Bool *event, _Bool *terminate, _Bool *early,
                    double *last);
typedef int (*keep)(instance, void **);
typedef int (*restore)(instance, void *);
typedef void (*release)(instance);

static void *library;

static void *function(const char *name) {
    void *found = dlsym(library, name);
    if (!found) {
        fprintf(stderr, "%s: not in the library\n", name);
        exit(1);
    }
    return found;
}

static void check(int status, const char *call) {
    if (status != 0) {
        fprintf(stderr, "%s: status %d\n", call, status);
        exit(1);
    }
}

static void tell(void *environment, int status, const char *category, const char *message) {
    (void)environment;
    fprintf(stderr, "status %d, %s: %s\n", status, category, message);
}

static size_t references(char *text, reference *found) {
    size_t count = 0;
    char *word;
    for (word = strtok(text, ","); word && count < MOST; word = strtok(NULL, ","))
        found[count++] = (reference)strtoul(word, NULL, 10);
    return count;
}

static double now(void) {
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

int main(int count, char **words) {
    reference inputs[MOST], outputs[MOST];
    static double forces[STEPS_OF_A_SECOND][MOST];
    double values[MOST] = {0}, last, begin, amplitude;
    size_t n, m, i;
    long k, steps;
    _Bool event, terminate, early;
    instance robot;
    void *start = NULL;
    if (count != 7 || !(library = dlopen(words[1], RTLD_NOW | RTLD_LOCAL))) {
        fprintf(stderr, "%s\n", count != 7 ? "six arguments expected" : dlerror());
        return 1;
    }
    steps = atol(words[3]);
    amplitude = atof(words[4]);
    n = references(words[5], inputs);
    m = references(words[6], outputs);
    set set_values = (set)function("fmi3SetFloat64");
    get get_values = (get)function("fmi3GetFloat64");
    step do_step = (step)function("fmi3DoStep");
    restore back = (restore)function("fmi3SetFMUState");
    robot = ((instantiate)function("fmi3InstantiateCoSimulation"))("robot", words[2], NULL, 0, 0, 0, 0, NULL, 0, NULL,
                                                                   tell, NULL);
    if (!robot) return 1;
    check(((enter)function("fmi3EnterInitializationMode"))(robot, 0, 0.0, 0.0, 0, 0.0), "enter initialization");
    check(((plain)function("fmi3ExitInitializationMode"))(robot), "exit initialization");
    check(((keep)function("fmi3GetFMUState"))(robot, &start), "get state");
    for (k = 0; k < STEPS_OF_A_SECOND; k++)
        for (i = 0; i < n; i++)
            forces[k][i] = amplitude * sin(6.283185307179586 * (double)(i + 1) * (double)k * STEP);
    begin = now();
    for (k = 0; k < steps; k++) {
        if (k && k % STEPS_OF_A_SECOND == 0) check(back(robot, start), "set state");
        check(set_values(robot, inputs, n, forces[k % STEPS_OF_A_SECOND], n), "set inputs");
        check(do_step(robot, (double)(k % STEPS_OF_A_SECOND) * STEP, STEP, 1, &event, &terminate, &early, &last), "step");
        check(get_values(robot, outputs, m, values, m), "get outputs");
    }
    printf("%.9g", now() - begin);
    for (i = 0; i < m; i++) printf(" %.17g", values[i]);
    printf("\n");
    ((keep)function("fmi3FreeFMUState"))(robot, &start);
    ((release)function("fmi3FreeInstance"))(robot);
    return dlclose(library);
}
