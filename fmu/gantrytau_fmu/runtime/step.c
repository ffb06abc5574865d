/* Co-Simulation: from one communication point to the next, with control of the error and events on the way. */

#ifndef GT_MOST_STEPS
#define GT_MOST_STEPS 20000
#endif
#define GT_MOST_IN_A_STEP (10 * GT_MOST_STEPS) /* events of one communication step */
#define GT_CROWDED_SHARE 1e-2 /* of a step: 100,000 events that are spread over it are none too many */
#define GT_SHORTEST 1e-13      /* of a communication step, and of the time itself */
#define GT_LEAST_LOOK 1e-4     /* of a communication step: shorter slips may be missed */
#define GT_QUARTER 1.6         /* rad: what angles in margins may turn in one step */
#define GT_LESS_THAN_HALF 2.   /* rad: what they may have turned when it ends */
#define GT_PACED 1e-3          /* of a step: what one counts that is short for the sake of angles */
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

/* How far everything is from its next event: the least of all, below zero behind one, and the gaps of what switches. */
typedef struct { gt_gaps gaps; double least; } gt_ahead;

/* At the present point. */
static gt_status gt_look_ahead(gt_instance *it, gt_ahead *found) {
    double frictions[GT_ROOM(GT_FRICTIONS)];
    gt_status status = gt_friction_indicators(it, frictions);
    int i;
    found->least = INFINITY;
    for (i = 0; i < GT_FRICTIONS && status == GT_OK; i++)
        found->least = fmin(found->least, frictions[i] <= 0 ? fmin(frictions[i], -1e-300) : frictions[i]);
    if (status == GT_OK) status = gt_look_at_gaps(it, &found->gaps);
    for (i = 0; i < GT_GAPS && status == GT_OK; i++)
        found->least = fmin(found->least, found->gaps.left[i] + found->gaps.noise[i]);
    return status;
}

/* The point that a step of size h from (t, x) leads to. */
static gt_status gt_try_to(gt_instance *it, double t, double h, const double *x, gt_ahead *there) {
    double error[GT_ROOM(GT_STATES)];
    const gt_status status = gt_try_step(it, t, h, x, it->next, error) == GT_OK ? gt_move(it, t + h, it->next) : GT_DISCARD;
    return status == GT_OK ? gt_look_ahead(it, there) : status;
}

/* The step of size h from (t, x) goes from before an event to behind it: find the shortest that does, by the secant whose
 * older end counts half (Illinois), and by halving where that is slow. */
static gt_status gt_locate(gt_instance *it, double t, double h, const double *x, double above, double below) {
    double before = 0, behind = h, width = h;
    gt_status status = GT_OK;
    gt_ahead there;
    int count, side = 0;
    for (count = 0; status == GT_OK && behind - before > GT_LOCATED + 4e-16 * (fabs(t) + behind); count++) {
        double share = above > 0 && below < 0 ? above / (above - below) : 0.5, middle;
        if (count % 4 == 3) {
            if (behind - before > width / 8) share = 0.5;
            width = behind - before;
        }
        middle = before + fmin(fmax(share, 1e-3), 1 - 1e-3) * (behind - before);
        status = gt_try_to(it, t, middle, x, &there);
        if (status != GT_OK) break;
        if (there.least < 0) {
            behind = middle;
            below = there.least;
            if (side < 0) above /= 2;
            side = -1;
        } else {
            before = middle;
            above = there.least;
            if (side > 0) below /= 2;
            side = 1;
        }
    }
    return status == GT_OK ? gt_try_to(it, t, behind, x, &there) : GT_DISCARD;
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
    if (!GT_FRICTIONS || *status != GT_OK || !gt_sticks(it)) return 0;
    *status = gt_find_spare(it, size, &later);
    if (*status == GT_OK && size > GT_LEAST_LOOK * span && gt_may_have_slipped(it, size, spare, &later)) {
        *status = gt_move(it, t, x);
        return 1;
    }
    *spare = later;
    return 0;
}

/* The share of the step of that size from (t, x) to the present point after which something may have switched that its
 * ends do not show; 1 if there is none. Then back there. */
static double gt_overlooked(gt_instance *it, double t, const double *x, double size, double span, const gt_gaps *first,
                            const gt_gaps *last, gt_status *status) {
    double share = 1;
    if (!GT_TURNS || *status != GT_OK) return 1;
    if (size * last->pace > GT_LESS_THAN_HALF && size > 10 * GT_SHORTEST * span) share = fmax(0.1, GT_QUARTER / (size * last->pace));
    else if (size <= GT_LEAST_LOOK * span) return 1;
    else share = gt_dip(size, first, last);
    if (share == 1 && gt_strays(it, t, size, x, it->k[GT_FIRST_RATES], first, last)) share = 0.5;
    if (share < 1) *status = gt_move(it, t, x);
    return share;
}

/* The size of the next step, after one whose error was `norm`. */
static double gt_next_size(double h, double size, double norm, int last, int rejected) {
    const double grown = norm < 1e-4 ? 5 : 0.9 * pow(norm, -1. / GT_ORDER), growth = fmin(rejected ? 1 : 5, grown);
    return !last || growth < 1 || size * growth > h ? size * growth : h;
}

/* Integrate to `end`, or to an event before; *event tells which. */
static gt_status gt_integrate(gt_instance *it, double end, int *event) {
    double error[GT_ROOM(GT_STATES)], x[GT_ROOM(GT_STATES)];
    const double span = end - it->now.time, shortest = fmax(GT_SHORTEST * span, 4.5e-16 * fabs(end));
    double h = it->now.size > 0 ? it->now.size : span;
    gt_spare spare;
    gt_ahead here, there;
    gt_status status = gt_prepare(it);
    double count = 0;
    int rejected = 0;
    *event = 0;
    if (GT_FRICTIONS && status == GT_OK) status = gt_find_spare(it, span, &spare);
    if (GT_INDICATORS && status == GT_OK) status = gt_look_ahead(it, &here);
    while (status == GT_OK && end - it->now.time > shortest) {
        const double t = it->now.time, rest = end - t;
#if GT_DELAYS
        h = fmin(h, it->memory.shortest);
#endif
        const int paced = GT_TURNS && h * here.gaps.pace >= GT_QUARTER;
        if (paced) h = GT_QUARTER / here.gaps.pace;
        const int last = h >= rest * (1 - 1e-9);
        const double size = last ? rest : h > 0.5 * rest ? 0.5 * rest : h, next = last ? end : t + size;
        double norm, share;
        int turned;
        if ((count += paced ? GT_PACED : 1) > GT_MOST_STEPS) return gt_too_many(it, t);
        memcpy(x, it->now.x, GT_STATES * sizeof(double));
        norm = gt_try_step(it, t, size, x, it->next, error) == GT_OK ? gt_error_norm(it, x, it->next, error) : INFINITY;
        turned = norm <= 1 && GT_SIDES ? gt_turned_at(it, next) : -1;
        if (!(norm <= 1) || turned >= 0) {
            if (!(norm < INFINITY) && (*event = gt_put_behind(it, size))) return GT_OK;
            share = turned >= 0 || !(norm < INFINITY) ? 0.25 : fmax(0.1, 0.9 * pow(norm, -1. / GT_ORDER));
            rejected = 1;
            status = gt_shorten(it, &h, share * size, shortest, turned);
            continue;
        }
        status = gt_move(it, next, it->next);
#if GT_DELAYS
        if (status == GT_OK && gt_too_wide(it, t, x, size, &status)) {
            rejected = 1;
            h = 0.5 * size;
            continue;
        }
#endif
        if (GT_INDICATORS && status == GT_OK) status = gt_look_ahead(it, &there);
        share = gt_overlooked(it, t, x, size, span, &here.gaps, &there.gaps, &status);
        if (GT_INDICATORS && status == GT_OK && share == 1 && there.least < 0) {
            *event = 1;
            status = gt_locate(it, t, size, x, here.least, there.least);
#if GT_DELAYS
            if (status == GT_OK) status = gt_remember(it);
#endif
            return status;
        }
        if (share == 1 && gt_slipped(it, t, x, size, span, &spare, &status)) share = 0.5;
        if (share < 1) {
            rejected = 1;
            h = share * size;
            continue;
        }
#if GT_DELAYS
        if (status == GT_OK) status = gt_keep_place(it, 0, 0);
#endif
        here = there;
        gt_tighten(it, &here.gaps);
        it->now.size = h = gt_next_size(h, size, norm, last, rejected);
        rejected = 0;
        if (status == GT_OK && !last) status = gt_accepted(it);
    }
    if (status == GT_OK) it->now.time = end;
    return status;
}

/* All that happens at the present time. */
static gt_status gt_handle_events(gt_instance *it) {
    gt_event_info info;
    do {
        const gt_status status = gt_update(it, &info);
        if (status != GT_OK) return status;
        if (it->now.time - it->counted_since > it->crowded) {
            it->counted = 0;
            it->counted_since = it->now.time;
        }
        it->counted += info.again;
        it->all += info.again;
        if (it->all > GT_MOST_IN_A_STEP)
            return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: more than %d events in one communication step, the last of %s at time = %.9g s; "
                          "take shorter steps", GT_NAME, GT_MOST_IN_A_STEP, it->last_event, it->now.time);
        if (it->counted > GT_MOST_EVENTS)
            return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: more than %d events within %.3g s of one communication step, the last of %s at time = "
                          "%.9g s; take a longer sampling period, or let come to rest what repeats ever faster", GT_NAME, GT_MOST_EVENTS,
                          it->crowded, it->last_event, it->now.time);
    } while (info.again);
    return GT_OK;
}

/* What happens at the end of a step. Samples wait for the inputs of the next one, and are taken of what was before. */
static gt_status gt_finish(gt_instance *it) {
    double periods[GT_ROOM(GT_CLOCKS)];
    int due[GT_ROOM(GT_CLOCKS)];
    gt_status status;
    if (!GT_MODES && !GT_WHENS) return GT_OK;
    it->closing = it->now.waiting = gt_find_due(it, periods, due);
    if (it->closing) gt_keep_before(it, 0);
    status = gt_handle_events(it);
    it->closing = 0;
    return status;
}

static gt_status gt_step(gt_instance *it, double time, double size, double *reached) {
    const double end = time + size;
    double turn = INFINITY;
    int event = 0;
    gt_status status = GT_OK;
    if (!(size > 4.5e-16 * fabs(end)))
        return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: found a step of %g s at time = %.9g s, expected one that a number of that size can "
                      "tell", GT_NAME, size, time);
    it->now.time = time;
    it->stepping = 1;
    it->counted = it->all = 0;
    it->counted_since = time;
    it->crowded = fmin(GT_CROWDED_SHARE * size, GT_CROWDED_TIME);
    if (it->now.waiting) gt_keep_before(it, 1);
    it->now.waiting = 0;
#if GT_DELAYS
    status = gt_begin_past(it);
#endif
    while (status == GT_OK) {
        double next;
        if (GT_CLOCKS || GT_MODES || GT_WHENS) status = gt_handle_events(it);
        if (it->now.ended) break;
        if (status == GT_OK) status = gt_next_turn(it, &turn);
        next = fmin(GT_CLOCKS ? gt_next_sample(it, end) : INFINITY, turn);
#if GT_DELAYS
        gt_arrive(it);
        if (status == GT_OK) status = gt_begin_piece(it);
        next = fmin(next, gt_next_arrival(&it->memory, it->now.time));
#endif
        if (status == GT_OK) status = gt_integrate(it, fmin(next, end), &event);
        if (!event && it->now.time >= end) break;
    }
    if (status == GT_OK && !it->now.ended) status = gt_finish(it);
    it->stepping = 0;
    if (status == GT_OK) gt_tell_limits(it);
    if (status != GT_OK && !it->now.stale) gt_step_back(it);
    it->time = it->now.time;
    *reached = it->now.time;
    if (status == GT_DISCARD) status = gt_too_short(it, it->now.size);
    return status;
}
