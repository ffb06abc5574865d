/* What the parts of the runtime share: the model's tables, one instance, and the calls between the parts.
 *
 * Everything that changes is inside a gt_instance; there are no global variables, so instances may run in
 * threads of their own. The FMI layers (fmi2.c, fmi3.c) check the order of calls and translate types; the
 * rest of the runtime knows nothing of FMI versions.
 */
#ifndef GT_CORE_H
#define GT_CORE_H

#include <stddef.h>
#include <stdint.h>

typedef enum { GT_OK, GT_WARNING, GT_DISCARD, GT_ERROR, GT_FATAL } gt_status; /* the order of FMI 2 and 3 */

/* Categories of log messages, named in the model description. */
typedef enum { GT_LOG_EVENTS, GT_LOG_CALLS, GT_LOG_WARNING, GT_LOG_ERROR, GT_LOG_CATEGORIES } gt_category;
#define GT_CATEGORY_NAMES { "logEvents", "logCalls", "logStatusWarning", "logStatusError" }

/* What a variable is; `index` counts within its kind. GT_HELD: sampled variables and Discretes. */
typedef enum {
    GT_TIME, GT_CONSTANT, GT_PARAMETER, GT_INPUT, GT_STATE, GT_DERIVATIVE, GT_OUTPUT, GT_HELD, GT_MODE, GT_INDICATOR
} gt_kind;

typedef struct {
    unsigned char kind;
    unsigned char fixed;  /* parameters: may not be changed after initialisation; states: found by initial equations */
    int index;
} gt_variable; /* its name is in gt_variable_names */

/* The declared min and max of a variable, infinite where there is none; size: its nominal. */
typedef struct { unsigned reference; double min, max, size; } gt_limit;

typedef enum { /* bits, so that a call can name all modes in which it is allowed */
    GT_INSTANTIATED = 1, GT_INITIALIZATION = 2, GT_EVENT = 4, GT_CONTINUOUS = 8, GT_STEP = 16, GT_TERMINATED = 32,
    GT_FAILED = 64
} gt_mode;

typedef struct gt_instance gt_instance;

/* Told what happened: `who` is the pointer given to gt_new; message is one line of plain text. */
typedef void (*gt_sink)(void *who, gt_status status, const char *category, const char *message);

/* ---- instance.c: life; gt_new returns NULL without memory, gt_reset goes back to what gt_new gave */
static gt_instance *gt_new(const char *name, gt_sink sink, void *who, int cosimulation, int logging);
static void gt_free(gt_instance *it);
static void gt_reset(gt_instance *it);
static void gt_logging(gt_instance *it, gt_category category, int on);
static gt_status gt_say(gt_instance *it, gt_status status, gt_category category, const char *format, ...);

/* ---- values.c: by value reference; references are places in gt_variables, of which there are GT_VARIABLES.
 * gt_get evaluates what the value depends on. gt_set refuses what may not be set in the present mode, NaN and
 * infinite values, with a log line that names the variable; gt_place is where it would set, NULL where it would refuse.
 * gt_mode_* are the integer variables (GT_MODE). */
static gt_status gt_get(gt_instance *it, unsigned reference, double *value);
static double *gt_place(gt_instance *it, unsigned reference, double value);
static gt_status gt_set(gt_instance *it, unsigned reference, double value);
static gt_status gt_get_integer(gt_instance *it, unsigned reference, int *value);
static void gt_tell_limits(gt_instance *it); /* a warning in the log, once for each variable beyond its min or max */

/* ---- initialize.c */
static void gt_setup(gt_instance *it, int tolerance_defined, double tolerance, double start, int stop_defined, double stop);
static gt_status gt_initialize(gt_instance *it); /* exit initialization mode: initial equations, first events */

/* ---- Model Exchange. x, rates (GT_STATES), indicators (GT_INDICATORS). */
static gt_status gt_set_time(gt_instance *it, double time);
static gt_status gt_set_states(gt_instance *it, const double *x);
static gt_status gt_get_states(gt_instance *it, double *x);
static gt_status gt_get_rates(gt_instance *it, double *rates);
static gt_status gt_get_indicators(gt_instance *it, double *indicators);
static void gt_get_nominals(const gt_instance *it, double *nominals);

typedef struct { int again, terminate, nominals_changed, states_changed, next_defined; double next; } gt_event_info;
static gt_status gt_update(gt_instance *it, gt_event_info *info); /* one event iteration */
static gt_status gt_completed(gt_instance *it); /* after a step of the importer: refuses one across a singular pose */

/* ---- step.c: Co-Simulation. The time is `time` afterwards, or where a failure stopped it. */
static gt_status gt_step(gt_instance *it, double time, double size, double *reached);

/* ---- derivatives.c: of outputs, derivatives of states and their aliases by states, inputs, and parameters.
 * directional: d_unknown (n) = J d_known (m); adjoint: d_known (m) = J' d_unknown (n). */
static gt_status gt_directional(gt_instance *it, const unsigned *unknown, size_t n, const unsigned *known, size_t m,
                                const double *d_known, double *d_unknown);
static gt_status gt_adjoint(gt_instance *it, const unsigned *unknown, size_t n, const unsigned *known, size_t m,
                            const double *d_unknown, double *d_known);

/* ---- state.c: a saved state is one block of memory that starts with a null pointer; it carries a checksum.
 * gt_restore refuses another model's, a damaged one, and one of the other kind of instance; `function` is for the log. Sizes in bytes; the block is the same, serialised or not. */
static size_t gt_state_size(const gt_instance *it);
static void gt_save(const gt_instance *it, void *block);
static gt_status gt_restore(gt_instance *it, const char *function, const void *block, size_t size);

/* GT_SELDOM: compiled for size, and not into what is not */
#if defined __GNUC__
#define GT_SELDOM __attribute__((cold, noinline))
#else
#define GT_SELDOM
#endif

/* ---- model.c, generated: tables and functions; see the end of instance.h */

#endif
