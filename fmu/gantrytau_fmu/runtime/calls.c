/* The calls that FMI 2 and FMI 3 have in common. `function` is the name that the caller knows it by. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "calls.h"

#define GT_REFUSE(c, ...) (gt_say((c)->it, GT_ERROR, GT_LOG_ERROR, __VA_ARGS__), GT_ERROR)
#define GT_COUNT(n) ((unsigned long)(n))

/* ---- The order of calls */

static const char *gt_mode_name(int mode) {
    switch (mode) {
        case GT_INSTANTIATED: return "instantiated mode";
        case GT_INITIALIZATION: return "initialization mode";
        case GT_EVENT: return "event mode";
        case GT_CONTINUOUS: return "continuous-time mode";
        case GT_STEP: return "step mode";
        case GT_TERMINATED: return "terminated mode";
        default: return "failed mode";
    }
}

/* The function that leads into a mode, without its prefix. */
static const char *gt_mode_entry(int mode, int cosimulation) {
    switch (mode) {
        case GT_INSTANTIATED: return "Reset";
        case GT_INITIALIZATION: return "EnterInitializationMode";
        case GT_EVENT: return cosimulation ? NULL : "EnterEventMode";
        case GT_CONTINUOUS: return cosimulation ? NULL : "EnterContinuousTimeMode";
        case GT_STEP: return cosimulation ? "ExitInitializationMode" : NULL;
        case GT_TERMINATED: return "Terminate";
        default: return NULL;
    }
}

static void gt_tell_order(const gt_component *c, const char *function, int modes) {
    int cosimulation = c->it->cosimulation;
    char expected[320] = "";
    size_t used = 0;
    int mode;
    for (mode = GT_INSTANTIATED; mode < GT_FAILED; mode *= 2) {
        const char *entry = gt_mode_entry(mode, cosimulation);
        if (!(modes & mode) || !entry) continue;
        used += (size_t)snprintf(expected + used, sizeof expected - used, "%s%s (after fmi%d%s)", used ? " or " : "",
                                 gt_mode_name(mode), c->version, entry);
        if (used >= sizeof expected) break;
    }
    gt_say(c->it, GT_ERROR, GT_LOG_ERROR, "%s: called in %s%s, expected %s", function, gt_mode_name(c->it->mode),
           c->it->mode == GT_FAILED ? " (after an error; only a reset or a saved state leads out)" : "", expected);
}

/* The component, if the call is allowed now, else NULL. kinds, modes: bits of those that allow it. */
static gt_component *gt_enter(void *instance, const char *function, int version, int kinds, int modes) {
    gt_component *c = instance;
    if (!c || c->version != version) return NULL;
    if (c->told[GT_LOG_CALLS])
        gt_say(c->it, GT_OK, GT_LOG_CALLS, "%s: called in %s", function, gt_mode_name(c->it->mode));
    if (!(kinds & (c->it->cosimulation ? GT_COSIMULATION : GT_EXCHANGE))) {
        gt_say(c->it, GT_ERROR, GT_LOG_ERROR, "%s: the instance is for %s, expected one for %s", function,
               c->it->cosimulation ? "Co-Simulation" : "Model Exchange",
               c->it->cosimulation ? "Model Exchange" : "Co-Simulation");
        return NULL;
    }
    if (!(c->it->mode & modes)) {
        gt_tell_order(c, function, modes);
        return NULL;
    }
    return c;
}

/* What failed on the way cannot be continued; a step that did not happen is an error too, for a client that gets
 * "discard" without progress may try for ever. */
static gt_status gt_fail(gt_component *c, gt_status status) {
    if (status < GT_DISCARD) return status;
    c->it->mode = GT_FAILED;
    return status == GT_DISCARD ? GT_ERROR : status;
}

/* ---- Arguments */

static int gt_has(const gt_component *c, const char *function, const char *what, const void *pointer, size_t count) {
    if (pointer || !count) return 1;
    gt_say(c->it, GT_ERROR, GT_LOG_ERROR, "%s: %s is NULL, expected %lu values", function, what, GT_COUNT(count));
    return 0;
}

static int gt_counts(const gt_component *c, const char *function, const char *what, size_t found, size_t expected) {
    if (found == expected) return 1;
    gt_say(c->it, GT_ERROR, GT_LOG_ERROR, "%s: %lu %s, expected %lu", function, GT_COUNT(found), what,
           GT_COUNT(expected));
    return 0;
}

static int gt_finite(const gt_component *c, const char *function, const char *what, double value) {
    if (isfinite(value)) return 1;
    gt_say(c->it, GT_ERROR, GT_LOG_ERROR, "%s: %s is %g, expected a finite number", function, what, value);
    return 0;
}

static int gt_known(const gt_component *c, const char *function, const unsigned *references, size_t count) {
    size_t i;
    if (!gt_has(c, function, "the array of value references", references, count)) return 0;
    for (i = 0; i < count; i++) {
        if (references[i] < GT_VARIABLES) continue;
        gt_say(c->it, GT_ERROR, GT_LOG_ERROR, "%s: value reference %u is unknown, expected 0 to %lu", function,
               references[i], GT_COUNT(GT_VARIABLES) - 1);
        return 0;
    }
    return 1;
}

/* ---- Values */

static int gt_values(const gt_component *c, const char *function, const unsigned *references, size_t count,
                     const void *values, size_t value_count) {
    return gt_counts(c, function, "values", value_count, count) &&
           gt_known(c, function, references, count) &&
           gt_has(c, function, "the array of values", values, count);
}

static int gt_is_real(const gt_component *c, const char *function, unsigned reference) {
    if (gt_variables[reference].kind != GT_MODE) return 1;
    gt_say(c->it, GT_ERROR, GT_LOG_ERROR, "%s: %s is an integer, expected a variable that is a real number", function,
           gt_name(reference));
    return 0;
}

static gt_status gt_call_get(gt_component *c, const char *function, const unsigned *references, size_t count,
                             double *values, size_t value_count) {
    gt_status worst = GT_OK;
    size_t i;
    if (!gt_values(c, function, references, count, values, value_count)) return GT_ERROR;
    for (i = 0; i < count && worst < GT_DISCARD; i++) {
        gt_status status = gt_is_real(c, function, references[i]) ? gt_get(c->it, references[i], values + i) : GT_ERROR;
        if (status > worst) worst = status;
    }
    return worst;
}

static gt_status gt_call_set(gt_component *c, const char *function, const unsigned *references, size_t count,
                             const double *values, size_t value_count) {
    size_t i;
    if (!gt_values(c, function, references, count, values, value_count)) return GT_ERROR;
    for (i = 0; i < count; i++) /* all or none */
        if (!gt_is_real(c, function, references[i]) || !gt_place(c->it, references[i], values[i])) return GT_ERROR;
    for (i = 0; i < count; i++) gt_set(c->it, references[i], values[i]);
    return GT_OK;
}

static gt_status gt_call_get_integer(gt_component *c, const char *function, const unsigned *references, size_t count,
                                     int *values, size_t value_count) {
    gt_status worst = GT_OK;
    size_t i;
    if (!gt_values(c, function, references, count, values, value_count)) return GT_ERROR;
    for (i = 0; i < count && worst < GT_DISCARD; i++) {
        gt_status status;
        if (gt_variables[references[i]].kind != GT_MODE)
            return GT_REFUSE(c, "%s: %s is a real number, expected an integer variable", function,
                             gt_name(references[i]));
        status = gt_get_integer(c->it, references[i], values + i);
        if (status > worst) worst = status;
    }
    return worst;
}

/* Variables of other types do not exist, and none of them may be set; an empty call is fine. */
static gt_status gt_call_none(gt_component *c, const char *function, const char *what, const unsigned *references,
                              size_t count) {
    if (!count) return GT_OK;
    if (!gt_known(c, function, references, count)) return GT_ERROR;
    return GT_REFUSE(c, "%s: %s is no %s; this FMU has none", function, gt_name(references[0]), what);
}

static gt_status gt_call_derivative(gt_component *c, const char *function, int adjoint, const unsigned *unknowns,
                                    size_t n, const unsigned *knowns, size_t m, const double *seed, size_t seeds,
                                    double *product, size_t products) {
    size_t i;
    if (!gt_known(c, function, unknowns, n) || !gt_known(c, function, knowns, m) ||
        !gt_counts(c, function, "seeds", seeds, adjoint ? n : m) ||
        !gt_counts(c, function, "sensitivities", products, adjoint ? m : n) ||
        !gt_has(c, function, "the array of seeds", seed, seeds) ||
        !gt_has(c, function, "the array of sensitivities", product, products))
        return GT_ERROR;
    for (i = 0; i < seeds; i++)
        if (!gt_finite(c, function, gt_name(adjoint ? unknowns[i] : knowns[i]), seed[i])) return GT_ERROR;
    return adjoint ? gt_adjoint(c->it, unknowns, n, knowns, m, seed, product)
                   : gt_directional(c->it, unknowns, n, knowns, m, seed, product);
}

/* ---- Experiment, modes */

static gt_status gt_call_setup(gt_component *c, const char *function, int tolerance_defined, double tolerance,
                               double start, int stop_defined, double stop) {
    if ((tolerance_defined && !gt_finite(c, function, "the tolerance", tolerance)) ||
        !gt_finite(c, function, "the start time", start) ||
        (stop_defined && !gt_finite(c, function, "the stop time", stop)))
        return GT_ERROR;
    if (tolerance_defined && !(tolerance > 0 && tolerance < 1))
        return GT_REFUSE(c, "%s: the tolerance is %g, expected more than 0 and less than 1", function, tolerance);
    if (stop_defined && stop < start)
        return GT_REFUSE(c, "%s: the stop time is %g s, expected no less than the start time, %g s", function, stop,
                         start);
    gt_setup(c->it, tolerance_defined, tolerance, start, stop_defined, stop);
    return GT_OK;
}

static gt_status gt_call_exit_initialization(gt_component *c) {
    gt_status status = gt_fail(c, gt_initialize(c->it));
    if (status < GT_DISCARD) c->it->mode = c->it->cosimulation ? GT_STEP : GT_EVENT;
    return status;
}

static gt_status gt_call_update(gt_component *c, gt_event_info *info) {
    gt_status status;
    memset(info, 0, sizeof *info);
    status = gt_fail(c, gt_update(c->it, info));
    c->it->now.unsettled = status < GT_DISCARD && info->again;
    return status;
}

static gt_status gt_call_continue(gt_component *c, const char *function) {
    if (c->it->now.unsettled)
        return GT_REFUSE(c, "%s: the event iteration has not ended, expected further calls of fmi%s first", function,
                         c->version == 2 ? "2NewDiscreteStates" : "3UpdateDiscreteStates");
    c->it->mode = GT_CONTINUOUS;
    return GT_OK;
}

/* ---- Model Exchange */

/* turned: whether something lies behind its turn that no importer can locate, as what a ramp of an input, whose rate is not
 * known here, leads to exactly zero and on. */
static gt_status gt_call_completed(gt_component *c, int *turned) {
    gt_gaps gaps;
    gt_status status = gt_fail(c, gt_completed(c->it));
#if GT_DELAYS
    if (status < GT_DISCARD) status = gt_fail(c, gt_remember(c->it));
#endif
    *turned = 0;
    if (status < GT_DISCARD) gt_tell_limits(c->it);
    if (GT_GAPS && status < GT_DISCARD && gt_look_at_gaps(c->it, &gaps) == GT_OK) {
        gt_tighten(c->it, &gaps);
        *turned = gt_lies_behind(c->it, &gaps);
    }
    return status;
}

static int gt_vector(const gt_component *c, const char *function, const char *what, const void *values, size_t count,
                     size_t expected) {
    return gt_counts(c, function, what, count, expected) && gt_has(c, function, "the array", values, count);
}

static const char *gt_state_name(size_t index) {
    size_t i;
    for (i = 0; i < GT_VARIABLES; i++)
        if (gt_variables[i].kind == GT_STATE && (size_t)gt_variables[i].index == index) return gt_name((unsigned)i);
    return "a state";
}

static gt_status gt_call_set_states(gt_component *c, const char *function, const double *x, size_t count) {
    size_t i;
    if (!gt_vector(c, function, "states", x, count, GT_STATES)) return GT_ERROR;
    for (i = 0; i < count; i++)
        if (!isfinite(x[i])) return gt_finite(c, function, gt_state_name(i), x[i]) ? GT_OK : GT_ERROR;
    return gt_set_states(c->it, x);
}

/* ---- Co-Simulation */

static gt_status gt_call_step(gt_component *c, const char *function, double point, double size, double *reached) {
    double slack = 1e-9 * (fabs(point) + fabs(size)); /* the client's sum of steps is rounded */
    *reached = c->it->time;
    if (!gt_finite(c, function, "the communication point", point) ||
        !gt_finite(c, function, "the step size", size))
        return GT_ERROR;
    if (size <= 0 || point + size <= point || !isfinite(point + size))
        return GT_REFUSE(c, "%s: the step size is %g s at %g s, expected one that advances the time", function, size,
                         point);
    if (fabs(point - c->it->time) > slack)
        return GT_REFUSE(c, "%s: the communication point is %.12g s, expected %.12g s, where the last step ended",
                         function, point, c->it->time);
    if (c->it->now.stop_defined && point + size > c->it->now.stop + slack + 1e-5 * size)
        return GT_REFUSE(c, "%s: the step ends at %.12g s, expected no later than the stop time, %.12g s", function,
                         point + size, c->it->now.stop);
    if (c->it->now.ended)
        return GT_REFUSE(c, "%s: the run has ended at %.12g s (%s), expected no further step", function, c->it->time,
                         gt_when_ends[c->it->now.ended - 1]);
    c->stepped = gt_fail(c, gt_step(c->it, point, size, reached));
    return c->stepped;
}

#include "component.c"
