/* Co-Simulation: from one communication point to the next, with control of the error and events on the way. */

#ifndef GT_MOST_STEPS
#define GT_MOST_STEPS 20000
#endif
#define GT_MOST_EVENTS 1000
#define GT_SHORTEST 1e-13      /* of a communication step, and of the time itself */
#define GT_LEAST_LOOK 1e-4     /* of a communication step: shorter slips may be missed */
#define GT_LOCATED 1e-13       /* s: how exactly an event is placed in time, beside rounding */

static double gt_error_norm(const gt_instance *it, const double *x, const double *next, const double *error) {
    double sum = 0;
    int i;
    for (i = 0; i < GT_STATES; i++) {
        const double scale = it->now.tolerance * (1e-3 * gt_x_nominals[i] + fmax(fabs(x[i]), fabs(next[i])));
        const double part = error[i] / scale;
        sum += part * part;
    }
    return GT_STATES ? sqrt(sum / GT_STATES) : 0;
}

/* Put the model where a step has led; z is solved anew. */
static gt_status gt_move(gt_instance *it, double time, const double *x) {
    it->now.time = time;
    memcpy(it->now.x, x, GT_STATES * sizeof(double));
    it->now.stale = it->outputs_stale = 1;
    if (GT_SIDES == 0 && GT_MODES == 0) return GT_OK;
    return gt_completed(it);
}

static int gt_crossed(gt_instance *it) {
    double indicators[GT_ROOM(GT_MODES)];
    int i;
    if (!GT_MODES || gt_get_indicators(it, indicators) != GT_OK) return 0;
    for (i = 0; i < GT_MODES; i++)
        if (indicators[i] <= 0) return 1;
    return 0;
}

/* The step of size h from (t, x) crosses: find the shortest that does, by halving. */
static gt_status gt_locate(gt_instance *it, double t, double h, const double *x) {
    double before = 0, behind = h, error[GT_ROOM(GT_STATES)];
    gt_status status = GT_OK;
    while (status == GT_OK && behind - before > GT_LOCATED + 4e-16 * (fabs(t) + behind)) {
        const double middle = before + 0.5 * (behind - before);
        if (gt_try_step(it, t, middle, x, it->next, error) != GT_OK) return GT_DISCARD;
        status = gt_move(it, t + middle, it->next);
        if (gt_crossed(it)) behind = middle;
        else before = middle;
    }
    if (status != GT_OK || gt_try_step(it, t, behind, x, it->next, error) != GT_OK) return GT_DISCARD;
    return gt_move(it, t + behind, it->next);
}

/* The state that changes most for its size. */
static int gt_fastest(const gt_instance *it) {
    int fastest = 0, i;
    double most = -1;
    for (i = 0; i < GT_STATES; i++) {
        const double rate = fabs(it->k[GT_FIRST_RATES][i]) / (gt_x_nominals[i] + fabs(it->now.x[i]));
        if (rate > most) {
            most = rate;
            fastest = i;
        }
    }
    return fastest;
}

static gt_status gt_too_short(gt_instance *it, double h) {
    return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: the steps of the integrator became shorter than %.2g s at time = %.9g s, where the fastest "
                  "state is %s; the motion may be meeting a singular pose or a limit of reach, or be too stiff for this solver",
                  GT_NAME, h, it->now.time, gt_x_names[gt_fastest(it)]);
}

static gt_status gt_too_many(gt_instance *it, double t) {
    return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: more than %d steps of the integrator in one communication step, at time = %.9g s, "
                  "where the fastest state is %s; take a shorter step, or the solver for stiff models", GT_NAME, GT_MOST_STEPS, t,
                  gt_x_names[gt_fastest(it)]);
}

/* The unknowns of a trial that was rejected may be so far on that a shorter one would find another solution from there. */
static void gt_step_back(gt_instance *it) {
    memcpy(it->now.z, it->now.solved_z, sizeof it->now.z);
}

/* The next size after a step that was too long; an error where that is no step any more. turned: what would have
 * turned at a singular pose, or -1. */
static gt_status gt_shorten(gt_instance *it, double *h, double size, double shortest, int turned) {
    *h = size;
    gt_step_back(it);
    if (size > shortest) return GT_OK;
    return turned >= 0 ? gt_side_fails(it, turned, "become singular") : gt_too_short(it, size);
}

/* What would turn at a singular pose if the step came to `time`, or -1. */
static int gt_turned_at(gt_instance *it, double time) {
    const double kept = it->now.time;
    int turned;
    it->now.time = time;
    turned = gt_turned(it);
    it->now.time = kept;
    return turned;
}

/* Whether a locked friction may have slipped on the step of that size from (t, x): then back there. *spare belongs to
 * the point where the step began, and then to where it has led. */
static int gt_slipped(gt_instance *it, double t, const double *x, double size, double span, gt_spare *spare, gt_status *status) {
    gt_spare later;
    if (!GT_MODES || *status != GT_OK || !gt_sticks(it)) return 0;
    *status = gt_find_spare(it, size, &later);
    if (*status == GT_OK && size > GT_LEAST_LOOK * span && gt_may_have_slipped(it, size, spare, &later)) {
        *status = gt_move(it, t, x);
        return 1;
    }
    *spare = later;
    return 0;
}

/* The size of the next step, after one whose error was `norm`. */
static double gt_next_size(double h, double size, double norm, int last, int rejected) {
    const double grown = norm < 1e-4 ? 5 : 0.9 * pow(norm, -1. / GT_ORDER), growth = fmin(rejected ? 1 : 5, grown);
    return !last || growth < 1 || size * growth > h ? size * growth : h;
}

/* Integrate to `end`, or to an event before; *event tells which. */
static gt_status gt_integrate(gt_instance *it, double end, int *count, int *event) {
    double error[GT_ROOM(GT_STATES)], x[GT_ROOM(GT_STATES)];
    const double span = end - it->now.time, shortest = fmax(GT_SHORTEST * span, 4.5e-16 * fabs(end));
    double h = it->now.size > 0 ? it->now.size : span;
    gt_spare spare;
    gt_status status = gt_prepare(it);
    int rejected = 0;
    *event = 0;
    if (GT_MODES && status == GT_OK) status = gt_find_spare(it, span, &spare);
    while (status == GT_OK && end - it->now.time > shortest) {
        const double t = it->now.time, rest = end - t;
        const int last = h >= rest * (1 - 1e-9);
        const double size = last ? rest : h > 0.5 * rest ? 0.5 * rest : h, next = last ? end : t + size;
        double norm;
        int turned;
        if (++*count > GT_MOST_STEPS) return gt_too_many(it, t);
        memcpy(x, it->now.x, GT_STATES * sizeof(double));
        norm = gt_try_step(it, t, size, x, it->next, error) == GT_OK ? gt_error_norm(it, x, it->next, error) : INFINITY;
        turned = norm <= 1 && GT_SIDES ? gt_turned_at(it, next) : -1;
        if (!(norm <= 1) || turned >= 0) {
            const double share = turned >= 0 || !(norm < INFINITY) ? 0.25 : fmax(0.1, 0.9 * pow(norm, -1. / GT_ORDER));
            rejected = 1;
            status = gt_shorten(it, &h, share * size, shortest, turned);
            continue;
        }
        status = gt_move(it, next, it->next);
        if (status == GT_OK && gt_crossed(it)) {
            *event = 1;
            return gt_locate(it, t, size, x);
        }
        if (gt_slipped(it, t, x, size, span, &spare, &status)) {
            rejected = 1;
            h = 0.5 * size;
            continue;
        }
        it->now.size = h = gt_next_size(h, size, norm, last, rejected);
        rejected = 0;
        if (status == GT_OK && !last) status = gt_accepted(it);
    }
    if (status == GT_OK) it->now.time = end;
    return status;
}

/* The friction events and samples at the present time. */
static gt_status gt_handle_events(gt_instance *it, int *events) {
    int again = 1;
    while (again) {
        gt_event_info info;
        const gt_status status = gt_update(it, &info);
        if (status != GT_OK) return status;
        again = info.again;
        *events += again;
        if (*events > GT_MOST_EVENTS)
            return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: more than %d events in one communication step, the last of %s at time = %.9g s; take "
                          "a shorter step, a longer sampling period, or smooth friction", GT_NAME, GT_MOST_EVENTS, it->last_event,
                          it->now.time);
    }
    return GT_OK;
}

static gt_status gt_step(gt_instance *it, double time, double size, double *reached) {
    const double end = time + size;
    int count = 0, events = 0, event = 0;
    gt_status status = GT_OK;
    if (!(size > 4.5e-16 * fabs(end)))
        return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: found a step of %g s at time = %.9g s, expected one that a number of that size can "
                      "tell", GT_NAME, size, time);
    it->now.time = time;
    if (GT_CLOCKS && it->now.first) {
        memcpy(it->now.u + GT_INPUTS, it->now.first_held, GT_HELD_COUNT * sizeof(double));
        memset(it->now.ticks, 0, sizeof it->now.ticks);
        it->now.stale = it->outputs_stale = 1;
    }
    it->now.first = 0;
    while (status == GT_OK) {
        double next;
        if (GT_CLOCKS || GT_MODES) status = gt_handle_events(it, &events);
        next = GT_CLOCKS ? gt_next_sample(it, end) : INFINITY;
        if (status == GT_OK) status = gt_integrate(it, fmin(next, end), &count, &event);
        if (!event && it->now.time >= end) break;
    }
    if (status != GT_OK && !it->now.stale) gt_step_back(it);
    it->time = it->now.time;
    *reached = it->now.time;
    if (status == GT_DISCARD) status = gt_too_short(it, it->now.size);
    return status;
}
