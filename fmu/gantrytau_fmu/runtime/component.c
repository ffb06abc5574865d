/* A component from its first call to its last: logging, life, saved states. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "calls.h"

/* ---- Logging */

static void gt_apply_logging(const gt_component *c) {
    int i;
    for (i = 0; i < GT_LOG_CATEGORIES; i++) gt_logging(c->it, (gt_category)i, c->told[i]);
}

/* Errors and warnings are told even while logging is off, for without them nobody learns why a call was refused;
 * only a call that switches off their category by its name silences them. Switching on selects, of events and
 * calls, those that are named, or both if none is; an instance made with logging on tells events only, for some
 * clients always make it so, and a line per call drowns the rest. */
static gt_status gt_call_logging(gt_component *c, const char *function, int on, size_t count,
                                 const char *const *categories) {
    static const char *const names[] = GT_CATEGORY_NAMES;
    unsigned char named[GT_LOG_CATEGORIES] = { 0 };
    size_t i;
    int k;
    if (!gt_has(c, function, "the array of categories", categories, count)) return GT_ERROR;
    for (i = 0; i < count; i++) {
        for (k = 0; k < GT_LOG_CATEGORIES; k++)
            if (categories[i] && !strcmp(categories[i], names[k])) break;
        if (k == GT_LOG_CATEGORIES)
            return GT_REFUSE(c, "%s: log category %.80s is unknown, expected %s, %s, %s or %s", function,
                             categories[i] ? categories[i] : "NULL", names[0], names[1], names[2], names[3]);
        named[k] = 1;
    }
    for (k = 0; k < GT_LOG_CATEGORIES; k++) {
        int failure = k == GT_LOG_WARNING || k == GT_LOG_ERROR;
        if (on) c->told[k] = (unsigned char)(failure || named[k] || !count);
        else if (named[k] || (!count && !failure)) c->told[k] = 0;
    }
    gt_apply_logging(c);
    return GT_OK;
}

/* ---- Life */

/* draft: version, environment and logger; before there is an instance it tells what is wrong. */
static void *gt_refuse_instance(gt_component *draft, gt_sink sink, const char *function, const char *what) {
    char text[200];
    snprintf(text, sizeof text, "%s: %s", function, what);
    sink(draft, GT_ERROR, "logStatusError", text);
    return NULL;
}

static void gt_call_free(gt_component *c) {
    if (!c) return;
    if (c->it) gt_free(c->it);
    c->version = 0; /* so that a second call has a chance to be noticed */
    free(c->name);
    free(c);
}

static gt_component *gt_call_instantiate(gt_component *draft, gt_sink sink, const char *function, const char *name,
                                         const char *token, int cosimulation, int logging) {
    gt_component *c;
    char text[160];
    draft->name = (char *)"";
    if (!name || !*name) return gt_refuse_instance(draft, sink, function, "the instance name is empty");
    draft->name = (char *)name;
    if (!token || strcmp(token, GT_TOKEN)) {
        snprintf(text, sizeof text, "the token is %.50s, expected %.50s: model description and library do not belong "
                 "together", token ? token : "NULL", GT_TOKEN);
        return gt_refuse_instance(draft, sink, function, text);
    }
    if (cosimulation ? !GT_HAS_CO_SIMULATION : !GT_HAS_MODEL_EXCHANGE)
        return gt_refuse_instance(draft, sink, function, cosimulation ? "this FMU has no Co-Simulation"
                                                                      : "this FMU has no Model Exchange");
    c = malloc(sizeof *c);
    if (!c) return gt_refuse_instance(draft, sink, function, "no memory");
    *c = *draft;
    c->told[GT_LOG_WARNING] = c->told[GT_LOG_ERROR] = 1;
    c->told[GT_LOG_EVENTS] = (unsigned char)(logging != 0);
    c->name = malloc(strlen(name) + 1);
    if (c->name) strcpy(c->name, name);
    c->it = c->name ? gt_new(c->name, sink, c, cosimulation, logging) : NULL;
    if (!c->it) {
        gt_call_free(c);
        return gt_refuse_instance(draft, sink, function, "no memory");
    }
    c->it->fmi = c->version;
    c->it->mode = GT_INSTANTIATED;
    gt_apply_logging(c);
    return c;
}

static void gt_call_reset(gt_component *c) {
    gt_reset(c->it);
    c->it->fmi = c->version;
    c->it->mode = GT_INSTANTIATED;
    c->stepped = GT_OK;
    gt_apply_logging(c);
}

/* ---- Saved states: the pointer that a client holds is the core's block itself */

static gt_status gt_call_save(gt_component *c, const char *function, void **state) {
    if (!gt_has(c, function, "the address for the state", state, 1)) return GT_ERROR;
    if (!*state) *state = malloc(gt_state_size(c->it));
    if (!*state) return GT_REFUSE(c, "%s: no memory for a state of %lu bytes", function, GT_COUNT(gt_state_size(c->it)));
    gt_save(c->it, *state);
    return GT_OK;
}

static gt_status gt_call_forget(gt_component *c, const char *function, void **state) {
    if (!gt_has(c, function, "the address of the state", state, 1)) return GT_ERROR;
    free(*state);
    *state = NULL;
    return GT_OK;
}

static gt_status gt_call_restore(gt_component *c, const char *function, const void *state) {
    gt_status status;
    if (!gt_has(c, function, "the state", state, 1)) return GT_ERROR;
    status = gt_restore(c->it, function, state, gt_state_size(c->it));
    gt_apply_logging(c);
    return status;
}

static gt_status gt_call_state_size(gt_component *c, const char *function, const void *state, size_t *size) {
    if (!gt_has(c, function, "the state", state, 1) || !gt_has(c, function, "the size", size, 1)) return GT_ERROR;
    *size = gt_state_size(c->it);
    return GT_OK;
}

static gt_status gt_call_serialize(gt_component *c, const char *function, const void *state, void *bytes, size_t size) {
    if (!gt_has(c, function, "the state", state, 1) || !gt_has(c, function, "the array of bytes", bytes, 1) ||
        !gt_counts(c, function, "bytes", size, gt_state_size(c->it)))
        return GT_ERROR;
    memcpy(bytes, state, size);
    return GT_OK;
}

static gt_status gt_call_deserialize(gt_component *c, const char *function, const void *bytes, size_t size,
                                     void **state) {
    const void *null = NULL; /* what a state starts with */
    if (!gt_has(c, function, "the array of bytes", bytes, 1) ||
        !gt_has(c, function, "the address for the state", state, 1) ||
        !gt_counts(c, function, "bytes", size, gt_state_size(c->it)))
        return GT_ERROR;
    if (memcmp(bytes, &null, sizeof null)) return GT_REFUSE(c, "%s: the bytes are no state of this FMU", function);
    if (!*state) *state = malloc(size);
    if (!*state) return GT_REFUSE(c, "%s: no memory for a state of %lu bytes", function, GT_COUNT(size));
    memcpy(*state, bytes, size);
    return GT_OK;
}
