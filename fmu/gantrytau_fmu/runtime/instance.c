/* One instance: its memory, its life, its log. The generated model.c stands before this file. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define GT_ROOM(n) ((n) + 1) /* ISO C knows no arrays of length zero */
#define GT_SIDES (GT_BLOCKS + GT_ROOTS) /* what shows singular poses: determinants, and roots in closed forms */
#define GT_STEPPING (GT_HELD_COUNT + GT_DISCRETES) /* what changes at instants only */
#define GT_MODES (GT_FRICTIONS + GT_TURNS)
#define GT_INDICATORS (GT_FRICTIONS + GT_GAPS) /* GT_GAPS: of each switch, two of one that counts */
#define GT_SLOPES (GT_STATES + GT_ALGEBRAICS + GT_OUTPUTS)
#define GT_LARGEST_BLOCK_ROOM GT_ROOM(GT_LARGEST_BLOCK)

/* What events change, as it was just before those of a communication point. */
typedef struct {
    double held[GT_ROOM(GT_STEPPING)], x[GT_ROOM(GT_STATES)], m[GT_ROOM(GT_MODES)], rest[GT_ROOM(GT_FRICTIONS)], ticks[GT_ROOM(GT_CLOCKS)];
    int holds[GT_ROOM(GT_WHENS)];
#ifdef GT_CONTROLLER
    controller_state controller;
#endif
} gt_earlier;

/* What a saved state holds: plain numbers, so that saving is a copy. */
typedef struct {
    double time;
    double x[GT_ROOM(GT_STATES)];
    double u[GT_ROOM(GT_KNOWN)];      /* inputs, then held variables, then Discretes, then what is delayed */
    double z[GT_ROOM(GT_ALGEBRAICS)]; /* unknowns of the implicit blocks */
    double p[GT_ROOM(GT_PARAMETERS)];
    double m[GT_ROOM(GT_MODES)];      /* of frictions: 1 forward, -1 backward, 0 locked; then of what switches */
    double ticks[GT_ROOM(GT_CLOCKS)]; /* the next sampling instant of a clock is start + ticks * period */
    double size;                      /* of the last step of the integrator, 0 before the first */
    double start, stop, tolerance;
    /* the last point where the equations were solved, from which others are reached */
    double solved_time, solved_x[GT_ROOM(GT_STATES)], solved_u[GT_ROOM(GT_KNOWN)], solved_z[GT_ROOM(GT_ALGEBRAICS)];
    double rest[GT_ROOM(GT_FRICTIONS)];   /* a sliding friction has stopped when it moves that fast the other way */
    /* measures of singular poses where the blocks were solved last, where the last step ended, and their rates on it */
    double sides[GT_ROOM(GT_SIDES)], kept_time, kept_sides[GT_ROOM(GT_SIDES)], side_rates[GT_ROOM(GT_SIDES)], largest_sides[GT_ROOM(GT_SIDES)];
    double kept_x[GT_ROOM(GT_STATES)], kept_u[GT_ROOM(GT_KNOWN)], kept_z[GT_ROOM(GT_ALGEBRAICS)], root_rates[GT_ROOM(GT_ROOTS)], kept_rates[GT_ROOM(GT_STATES)]; /* there, in Model Exchange */
    gt_earlier before;
    int holds[GT_ROOM(GT_WHENS)];     /* whether conditions of whens did when they were looked at last */
    double slack[GT_ROOM(GT_GAPS)];   /* how far behind a turn its mode was found to be that before it, for it turns round there */
    int ended;                        /* number, from 1, of the when that has ended the run */
    int events;                       /* since events_since, s */
    double events_since;
    int given[GT_ROOM(GT_STATES)];    /* states that were set before initialisation */
    int stop_defined, mode, cosimulation, initialized, stale, starts_stale;
    int waiting;   /* samples are due that are taken with the inputs of the next step, from what was before */
    int ready;     /* the experiment is set up */
    int unsettled; /* the last event iteration asked for another one */
#ifdef GT_CONTROLLER
    controller_state controller; /* C of its own, whose step is what is sampled */
#endif
} gt_state;

#if GT_DELAYS
#define GT_MEMORY 4096
#define GT_FIRST_DELAY (GT_KNOWN - GT_DELAYS)

/* What delays look back at, which belongs to a saved state, too: a ring of places. */
typedef struct {
    double t[GT_MEMORY], kept[GT_MEMORY][GT_DELAYS][3]; /* values, rates, second rates */
    int left[GT_MEMORY];     /* how often what is not smooth behind a place arrives a delay later */
    int straight[GT_MEMORY]; /* before a place inputs moved, at unknown rates: a line leads to it */
    double first[GT_DELAYS]; /* values before the start */
    double delays[GT_DELAYS], shortest, longest, sizes[GT_DELAYS], since; /* s; when the present smooth piece began */
    double u[GT_ROOM(GT_KNOWN)], x[GT_ROOM(GT_STATES)], p[GT_ROOM(GT_PARAMETERS)], m[GT_ROOM(GT_MODES)]; /* at the last place */
    int begun, oldest, count;
} gt_memory;
#endif

struct gt_instance {
    gt_state now;
#if GT_DELAYS
    gt_memory memory;
    double place[GT_DELAYS][3];
#endif
    gt_mode mode;
    double time; /* as the caller knows it */
    int cosimulation, fmi;
    void *who;
    gt_sink sink;
    int logging[GT_LOG_CATEGORIES];
    int parameters_stale, outputs_stale, factors_stale;
    int stepping; /* in a step: modes hold up to events */
    int counted;  /* events since counted_since, s, of one step */
    double counted_since, crowded; /* s */
    int all;      /* events of one step */
    int closing;  /* at its end, where samples wait for the next one */
    int sampling; /* values just before an instant are asked for: what turns there has not turned */
    const double *a[GT_ARRAYS + 1];
    double c[GT_ROOM(GT_HOISTED)], w[GT_ROOM(GT_WORK)], y[GT_ROOM(GT_OUTPUTS)];
    double matrices[GT_ROOM(GT_MATRICES)]; /* factored Jacobians of the blocks, one after another */
    int pivots[GT_ROOM(GT_ALGEBRAICS)];
    double scales[GT_ROOM(GT_ALGEBRAICS)];
    double e[GT_ROOM(GT_WHENS)]; /* 1 where a condition has become true */
    double dt, dx[GT_ROOM(GT_STATES)], du[GT_ROOM(GT_KNOWN)], dz[GT_ROOM(GT_ALGEBRAICS)], dp[GT_ROOM(GT_PARAMETERS)];
    double g[GT_ROOM(GT_SLOPES)];
    /* slopes of the initial equations by the states that they determine, factored */
    double initial[GT_ROOM(GT_INITIAL * GT_INITIAL)], initial_scales[GT_ROOM(GT_INITIAL)];
    int initial_pivots[GT_ROOM(GT_INITIAL)];
    double k[7][GT_ROOM(GT_STATES)], trial[GT_ROOM(GT_STATES)], next[GT_ROOM(GT_STATES)];
    double jacobian[GT_ROOM(GT_STATES * GT_STATES)], rate_of_time[GT_ROOM(GT_STATES)];
    int order[GT_ROOM(GT_STATES)];
#if GT_LEVELS
    /* all variables with their derivatives, and their jumps; before a turn: these, the states and the modes */
    double symbols[GT_SYMBOLS], jumps[GT_LEVELS * GT_UNKNOWNS], impulses[GT_UNKNOWNS * GT_UNKNOWNS];
    double symbols_before[GT_SYMBOLS], x_before[GT_ROOM(GT_STATES)], m_before[GT_ROOM(GT_MODES)], late;
    int jumping;
#endif
    int resting; /* at the start: what is told of the states holds behind what turns there */
    const char *last_event; /* name of the variable */
    double rows[GT_ROOM(GT_STATES)];
    unsigned char beyond[GT_ROOM(GT_LIMITS)]; /* whether it was told */
};

static const char *const gt_category_names[] = GT_CATEGORY_NAMES;

static gt_status gt_say(gt_instance *it, gt_status status, gt_category category, const char *format, ...) {
    char text[1024];
    va_list arguments;
    if (!it->sink || !it->logging[category]) return status;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    it->sink(it->who, status, gt_category_names[category], text);
    return status;
}

/* Calls between the parts that core.h does not name. */
static gt_status gt_initial_equations(gt_instance *it);
static gt_status gt_check_clocks(gt_instance *it);
static gt_status gt_begin_modes(gt_instance *it);
static gt_status gt_begin_whens(gt_instance *it);
static gt_status gt_agree(gt_instance *it, int *changed);
static int gt_other_side(const gt_instance *it);
#if GT_DELAYS
static gt_status gt_factors(gt_instance *it);
static void gt_clear_direction(gt_instance *it);
static void gt_along_states(gt_instance *it, int parameters);
static gt_status gt_solve(gt_instance *it, int quiet);
static gt_status gt_move(gt_instance *it, double time, const double *x);
static gt_status gt_check_delays(gt_instance *it);
#endif

/* A time for differences: short within `span`, but one that numbers of the size of `time` can tell. */
static double gt_small_time(double time, double span) {
    return fmax(1e-6 * span, fmin(1e-2 * span, 1e-9 * fabs(time)));
}

/* Where the functions of the model find their arguments; the order is that of ARRAYS in code/model_code.py. */
static void gt_point_at(gt_instance *it, const double *time, const double *x) {
    it->a[0] = time;
    it->a[1] = x;
}

/* Keep what events change, or go back to what was kept. */
static void gt_keep_before(gt_instance *it, int back) {
    gt_earlier *before = &it->now.before;
#define GT_COPY(kept, now, size) memcpy(back ? (void *)(now) : (void *)(kept), back ? (kept) : (now), size)
    GT_COPY(before->held, it->now.u + GT_INPUTS, GT_STEPPING * sizeof(double));
    GT_COPY(before->x, it->now.x, sizeof before->x);
    GT_COPY(before->m, it->now.m, sizeof before->m);
    GT_COPY(before->rest, it->now.rest, sizeof before->rest);
    GT_COPY(before->ticks, it->now.ticks, sizeof before->ticks);
    GT_COPY(before->holds, it->now.holds, sizeof before->holds);
#ifdef GT_CONTROLLER
    GT_COPY(&before->controller, &it->now.controller, sizeof before->controller);
#endif
#undef GT_COPY
    if (back) it->now.ended = 0, it->now.stale = it->outputs_stale = 1;
}

static void gt_reset(gt_instance *it) {
    memset(&it->now, 0, sizeof it->now);
#if GT_DELAYS
    memset(&it->memory, 0, sizeof it->memory);
#endif
    memcpy(it->now.x, gt_start_x, GT_STATES * sizeof(double));
    memcpy(it->now.u, gt_start_u, GT_KNOWN * sizeof(double));
    memcpy(it->now.z, gt_start_z, GT_ALGEBRAICS * sizeof(double));
    memcpy(it->now.p, gt_start_p, GT_PARAMETERS * sizeof(double));
    memcpy(it->now.solved_x, gt_start_x, GT_STATES * sizeof(double));
    memcpy(it->now.solved_u, gt_start_u, GT_KNOWN * sizeof(double));
    memcpy(it->now.solved_z, gt_start_z, GT_ALGEBRAICS * sizeof(double));
    memcpy(it->now.m, gt_start_m, GT_MODES * sizeof(double));
#ifdef GT_CONTROLLER
    controller_init(&it->now.controller);
#endif
    memset(it->beyond, 0, sizeof it->beyond);
    it->now.tolerance = GT_TOLERANCE;
    it->now.stale = 1;
    it->mode = GT_INSTANTIATED;
    it->stepping = it->closing = it->sampling = 0;
    it->time = 0;
    it->parameters_stale = it->outputs_stale = it->factors_stale = 1;
    it->dt = 0;
    it->a[2] = it->now.u;
    it->a[3] = it->now.z;
    it->a[4] = it->now.p;
    it->a[5] = it->now.m;
    it->a[6] = it->e;
    it->a[7] = &it->dt;
    it->a[8] = it->dx;
    it->a[9] = it->du;
    it->a[10] = it->dz;
    it->a[11] = it->dp;
#if GT_LEVELS
    it->a[12] = it->symbols;
    it->a[13] = it->jumps;
#endif
    it->a[14] = it->c;
    gt_point_at(it, &it->now.time, it->now.x);
}

static gt_instance *gt_new(const char *name, gt_sink sink, void *who, int cosimulation, int logging) {
    gt_instance *it = calloc(1, sizeof *it);
    (void)name;
    if (!it) return NULL;
    it->sink = sink;
    it->who = who;
    it->cosimulation = cosimulation;
    it->logging[GT_LOG_EVENTS] = it->logging[GT_LOG_CALLS] = logging;
    it->logging[GT_LOG_WARNING] = it->logging[GT_LOG_ERROR] = 1; /* what went wrong is always told */
    gt_reset(it);
    return it;
}

static void gt_free(gt_instance *it) {
    free(it);
}

static void gt_logging(gt_instance *it, gt_category category, int on) {
    it->logging[category] = on;
}
