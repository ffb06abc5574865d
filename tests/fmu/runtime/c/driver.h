/* What the drivers share: the FMU as part of the program, what it logs, and a failure that tells where. */
#include "fmu.c"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static char said[2048];   /* the last line that an instance logged as an error */
static int lines;         /* how many of them since the last call of `listen` */
static int all_lines;     /* of any kind */

static void hear(int status, const char *message) {
    all_lines++;
    if (status < GT_DISCARD) return;
    lines++;
    snprintf(said, sizeof said, "%s", message);
}

static void logger_2(void *environment, const char *name, fmi2Status status, const char *category, const char *format, ...) {
    char text[2048];
    va_list more;
    (void)environment, (void)name, (void)category;
    va_start(more, format);
    vsnprintf(text, sizeof text, format, more);
    va_end(more);
    hear((int)status, text);
}

static void logger_3(void *environment, fmi3Status status, const char *category, const char *message) {
    (void)environment, (void)category;
    hear((int)status, message);
}

static void *allocate(size_t count, size_t size) { return calloc(count, size); }

static const fmi2CallbackFunctions callbacks = {logger_2, allocate, free, NULL, NULL};

/* A new instance of version 2 or 3, or NULL. */
static void *make(int version, int cosimulation, const char *name, const char *token, int logging) {
    if (version == 2)
        return fmi2Instantiate(name, cosimulation ? fmi2CoSimulation : fmi2ModelExchange, token, "", &callbacks, 0, logging);
    if (cosimulation)
        return fmi3InstantiateCoSimulation(name, token, "", false, logging != 0, false, false, NULL, 0, NULL, logger_3, NULL);
    return fmi3InstantiateModelExchange(name, token, "", false, logging != 0, NULL, logger_3);
}

/* Up to initialization mode, then to event or step mode. */
static int enter(void *c, int version, double start) {
    if (version == 3) return (int)fmi3EnterInitializationMode(c, false, 0, start, false, 0);
    return fmi2SetupExperiment(c, 0, 0, start, 0, 0) ? 3 : (int)fmi2EnterInitializationMode(c);
}

static int leave(void *c, int version) {
    return version == 3 ? (int)fmi3ExitInitializationMode(c) : (int)fmi2ExitInitializationMode(c);
}

static int step(void *c, int version, double point, double size) {
    bool event, terminate, early;
    double reached;
    return version == 3 ? (int)fmi3DoStep(c, point, size, true, &event, &terminate, &early, &reached)
                        : (int)fmi2DoStep(c, point, size, 1);
}

static int set_real(void *c, int version, unsigned reference, double value) {
    return version == 3 ? (int)fmi3SetFloat64(c, &reference, 1, &value, 1) : (int)fmi2SetReal(c, &reference, 1, &value);
}

static int get_real(void *c, int version, unsigned reference, double *value) {
    return version == 3 ? (int)fmi3GetFloat64(c, &reference, 1, value, 1) : (int)fmi2GetReal(c, &reference, 1, value);
}

static void release(void *c, int version) {
    if (version == 3) fmi3FreeInstance(c);
    else fmi2FreeInstance(c);
}

/* The first variable of a kind, or GT_VARIABLES. */
static unsigned first_of(gt_kind kind) {
    unsigned i = 0;
    while (i < GT_VARIABLES && gt_variables[i].kind != kind) i++;
    return i;
}

static int part_of_a_name(char c) {
    return c == '_' || (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}

/* Whether a word stands in a text by itself. */
static int has_word(const char *text, const char *word) {
    const size_t length = strlen(word);
    const char *at = length ? strstr(text, word) : NULL;
    for (; at; at = strstr(at + 1, word))
        if ((at == text || !part_of_a_name(at[-1])) && !part_of_a_name(at[length])) return 1;
    return 0;
}

/* Whether a line names a function of FMI or a variable of the model. */
static int names_something(const char *line) {
    int i;
    if (strstr(line, "fmi2") || strstr(line, "fmi3")) return 1;
    for (i = 0; i < GT_VARIABLES; i++)
        if (has_word(line, gt_variable_names[i])) return 1;
    for (i = 0; i < GT_STATES; i++)
        if (has_word(line, gt_x_names[i])) return 1;
    for (i = 0; i < GT_ALGEBRAICS; i++)
        if (has_word(line, gt_z_names[i])) return 1;
    for (i = 0; i < GT_HELD_COUNT; i++)
        if (has_word(line, gt_held_names[i])) return 1;
    return 0;
}
