/* Events: samples (samples.c), friction that locks, slides forward or backward, switches that turn (turns.c), and what is done when conditions become true.
 *
 * While a friction is locked its force is an unknown that keeps the speed at zero; it breaks away when that
 * force passes its limit. A sliding one locks when its speed comes to zero.
 */

#define GT_REST 1e-8         /* m/s or rad/s: a speed that has gone that far beyond zero has crossed it */
#define GT_MARGIN 1e-9       /* of the breakaway force */
#define GT_MOST_ROUNDS 50    /* of whens at one instant */
#define GT_MOST_EVENTS 1000  /* within GT_CROWDED of the run, but no more than GT_CROWDED_TIME */
#define GT_CROWDED 1e-5
#define GT_CROWDED_TIME 1e-3 /* s: of a motion that goes on, a million events in a second are not expected */

/* Speed and breakaway force of each friction, (2, GT_FRICTIONS), rows first. */
static gt_status gt_laws(gt_instance *it, double *laws) {
    const gt_status status = gt_refresh(it);
    if (status == GT_OK && GT_FRICTIONS) gt_friction(it->a, laws, it->w);
    return status;
}

static double gt_indicator(const gt_instance *it, const double *laws, int i) {
    const double speed = laws[2 * i], breakaway = laws[2 * i + 1], force = it->now.z[gt_friction_unknowns[i]];
    if (it->now.m[i] != 0) return it->now.m[i] * speed + it->now.rest[i];
    return breakaway - fabs(force) + GT_MARGIN * (1 + breakaway);
}

/* Of the frictions. */
static gt_status gt_friction_indicators(gt_instance *it, double *indicators) {
    double laws[GT_ROOM(2 * GT_FRICTIONS)];
    gt_status status = gt_laws(it, laws);
    int i;
    for (i = 0; i < GT_FRICTIONS && status == GT_OK; i++) {
        indicators[i] = gt_indicator(it, laws, i);
        if (!isfinite(indicators[i]))
            return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: speed or limit of %s is not a finite number at time = %.9g s", GT_NAME,
                          gt_z_names[gt_friction_unknowns[i]], it->now.time);
    }
    return status;
}

/* Frictions, then gaps of what switches: rounding is their hysteresis, so that one is not passed where it turns. */
static gt_status gt_get_indicators(gt_instance *it, double *indicators) {
    gt_gaps gaps;
    gt_status status = gt_present(it);
    int i;
    if (status == GT_OK) status = gt_friction_indicators(it, indicators);
    if (status == GT_OK) status = gt_look_at_gaps(it, &gaps);
    for (i = 0; i < GT_GAPS && status == GT_OK; i++) indicators[GT_FRICTIONS + i] = gaps.left[i] + gaps.noise[i];
    return status;
}

static void gt_set_mode(gt_instance *it, int i, double mode, double speed) {
    static const char *const words[] = {"slides backward", "is locked", "slides forward"};
    it->now.m[i] = mode;
    it->last_event = gt_z_names[gt_friction_unknowns[i]];
    it->now.rest[i] = GT_REST + fmax(0, -mode * speed);
    it->now.stale = it->outputs_stale = 1;
    gt_say(it, GT_OK, GT_LOG_EVENTS, "%s: %s %s from time = %.9g s on", GT_NAME, gt_z_names[gt_friction_unknowns[i]],
           words[(int)mode + 1], it->now.time);
}

/* Release the locked frictions that cannot hold, the worst first, until all hold. */
static gt_status gt_settle(gt_instance *it) {
    double laws[GT_ROOM(2 * GT_FRICTIONS)];
    int round, i;
    for (round = 0; round <= 2 * GT_FRICTIONS; round++) {
        int worst = -1;
        double least = 0;
        const gt_status status = gt_laws(it, laws);
        if (status != GT_OK) return status;
        for (i = 0; i < GT_FRICTIONS; i++) {
            const double spare = gt_indicator(it, laws, i);
            if (it->now.m[i] == 0 && spare < least) {
                least = spare;
                worst = i;
            }
        }
        if (worst < 0) return GT_OK;
        gt_set_mode(it, worst, it->now.z[gt_friction_unknowns[worst]] > 0 ? 1 : -1, laws[2 * worst]);
    }
    return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: the frictions find no state of sticking and sliding at time = %.9g s; take smooth "
                  "friction", GT_NAME, it->now.time);
}

static gt_status gt_begin_modes(gt_instance *it) {
    double laws[GT_ROOM(2 * GT_FRICTIONS)];
    gt_status status;
    int i;
    if (!GT_FRICTIONS) return GT_OK;
    status = gt_laws(it, laws);
    if (status != GT_OK) return status;
    for (i = 0; i < GT_FRICTIONS; i++)
        gt_set_mode(it, i, laws[2 * i] > GT_REST ? 1 : laws[2 * i] < -GT_REST ? -1 : 0, laws[2 * i]);
    it->now.stale = 1;
    return gt_settle(it);
}

/* Lock what has come to rest and release what breaks away; *changed tells whether a mode has changed. */
static gt_status gt_friction_events(gt_instance *it, int *changed) {
    double laws[GT_ROOM(2 * GT_FRICTIONS)], before[GT_ROOM(GT_FRICTIONS)];
    gt_status status;
    int i;
    *changed = 0;
    if (!GT_FRICTIONS) return GT_OK;
    memcpy(before, it->now.m, sizeof before);
    status = gt_laws(it, laws);
    if (status != GT_OK) return status;
    for (i = 0; i < GT_FRICTIONS; i++)
        if (it->now.m[i] != 0 && gt_indicator(it, laws, i) <= 0.5 * GT_REST) gt_set_mode(it, i, 0, 0);
    status = gt_settle(it);
    for (i = 0; i < GT_FRICTIONS; i++) *changed |= it->now.m[i] != before[i];
    return status;
}

/* How far locked frictions are from breaking away, and its rates. */
typedef struct { double forces[GT_ROOM(GT_FRICTIONS)], rates[GT_ROOM(GT_FRICTIONS)]; } gt_spare;

/* At the present point; the rates are a difference within `span`. */
static gt_status gt_find_spare(gt_instance *it, double span, gt_spare *found) {
    double slopes[GT_ROOM(GT_STATES)], moved[GT_ROOM(GT_FRICTIONS)];
    gt_status status = gt_friction_indicators(it, found->forces);
    const gt_state kept = it->now;
    const double delta = gt_small_time(kept.time, span);
    int i;
    if (status == GT_OK) status = gt_get_rates(it, slopes);
    if (status != GT_OK) return status;
    for (i = 0; i < GT_STATES; i++) it->now.x[i] += delta * slopes[i];
    it->now.time += delta;
    it->now.stale = 1;
    status = gt_friction_indicators(it, moved);
    for (i = 0; i < GT_FRICTIONS && status == GT_OK; i++) found->rates[i] = (moved[i] - found->forces[i]) / delta;
    it->now = kept;
    it->outputs_stale = it->factors_stale = 1;
    gt_point_at(it, &it->now.time, it->now.x);
    return status;
}

/* The least of the cubic that has these values and rates at both ends of a step, at seven places between. */
static double gt_least_between(double step, double first, double rate, double last, double last_rate) {
    double least = INFINITY;
    int k;
    for (k = 1; k < 8; k++) {
        const double s = k / 8., r = 1 - s;
        least = fmin(least, r * r * (1 + 2 * s) * first + s * s * (1 + 2 * r) * last + step * s * r * (r * rate - s * last_rate));
    }
    return least;
}

/* Whether a locked friction may have broken away between two points a step apart: its spare force comes down between
 * them, or goes from one to the other but not at the rates that it has there. The step is too long to know. */
static int gt_may_have_slipped(const gt_instance *it, double step, const gt_spare *first, const gt_spare *last) {
    int i;
    for (i = 0; i < GT_FRICTIONS; i++) {
        const double before = first->forces[i], after = last->forces[i], smaller = fmin(before, after);
        const double led = 0.5 * step * (first->rates[i] + last->rates[i]);
        if (it->now.m[i] != 0) continue;
        if (fabs(after - before - led) > 0.1 * smaller + 1e-4 * fabs(led)) return 1;
        if (gt_least_between(step, before, first->rates[i], after, last->rates[i]) < 0.5 * smaller) return 1;
    }
    return 0;
}

static int gt_sticks(const gt_instance *it) {
    int i;
    for (i = 0; i < GT_FRICTIONS; i++)
        if (it->now.m[i] == 0) return 1;
    return 0;
}

/* Which conditions of whens hold at the present point, with its modes. */
static gt_status gt_find_conditions(gt_instance *it, int *holds) {
    double found[GT_ROOM(GT_WHENS)];
    const gt_status status = gt_refresh(it);
    int i;
    if (status != GT_OK) return status;
    gt_conditions_hold(it->a, found, it->w);
    for (i = 0; i < GT_WHENS; i++) holds[i] = found[i] != 0; /* NaN holds: what is not finite stops the run elsewhere */
    return GT_OK;
}

/* What is true at the start, behind its samples, has not become true, but for whens that act initially. */
static gt_status gt_begin_whens(gt_instance *it) {
    int changed, i;
    gt_status status = GT_OK;
    it->now.ended = it->now.events = 0;
    it->now.events_since = it->now.time;
    if (!GT_WHENS) return GT_OK;
    it->resting = 1;
    status = gt_agree(it, &changed);
    it->resting = 0;
    for (i = 0; i < GT_WHENS; i++) it->now.holds[i] = !gt_when_initially[i];
    return status;
}

static gt_status gt_jump_fails(gt_instance *it, const char *name) {
    return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: at time = %.9g s the new value of %s is not a finite number; look for a division by zero or "
                  "a root of a negative number in the actions of its when", GT_NAME, it->now.time, name);
}

/* Act where conditions have become true since they were looked at last, all from the values before; *acted: whether any has. */
static gt_status gt_act(gt_instance *it, gt_event_info *info, int *acted) {
    double found[GT_ROOM(GT_WHENS + GT_DISCRETES + GT_REINITS)];
    double *const discretes = it->now.u + GT_INPUTS + GT_HELD_COUNT;
    int holds[GT_ROOM(GT_WHENS)], first = 0, i;
    gt_status status = gt_find_conditions(it, holds);
    *acted = 0;
    if (status != GT_OK) return status;
    for (i = 0; i < GT_WHENS; i++) first |= holds[i] && !it->now.holds[i] && !gt_when_waits[i];
    for (i = 0; i < GT_WHENS; i++) {
        holds[i] &= !(first && gt_when_waits[i] && !it->now.holds[i]); /* what waits for others has not become true yet */
        it->e[i] = holds[i] && !it->now.holds[i];
        *acted |= it->e[i] != 0;
        if (it->e[i] != 0) it->last_event = gt_when_names[i];
    }
    memcpy(it->now.holds, holds, GT_WHENS * sizeof(int));
    if (!*acted) return GT_OK;
    gt_jump(it->a, found, it->w);
    for (i = 0; i < GT_WHENS; i++)
        if (found[i] != 0 && *gt_when_fails[i])
            return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: at time = %.9g s %s", GT_NAME, it->now.time, gt_when_fails[i]);
    for (i = 0; i < GT_DISCRETES; i++)
        if (!isfinite(found[GT_WHENS + i])) return gt_jump_fails(it, gt_held_names[GT_HELD_COUNT + i]);
    for (i = 0; i < GT_REINITS; i++)
        if (!isfinite(found[GT_WHENS + GT_DISCRETES + i])) return gt_jump_fails(it, gt_x_names[gt_reinit_states[i]]);
    for (i = 0; i < GT_WHENS; i++) {
        if (found[i] == 0) continue;
        gt_say(it, GT_OK, GT_LOG_EVENTS, "%s: at time = %.9g s %s acts", GT_NAME, it->now.time, gt_when_names[i]);
        if (!*gt_when_ends[i] || it->now.ended) continue;
        it->now.ended = i + 1; /* a warning, so that it is told also where events are not */
        gt_say(it, GT_OK, GT_LOG_WARNING, "%s: ended at time = %.9g s: %s", GT_NAME, it->now.time, gt_when_ends[i]);
    }
    memcpy(discretes, found + GT_WHENS, GT_DISCRETES * sizeof(double));
    for (i = 0; i < GT_REINITS; i++) {
        double *x = it->now.x + gt_reinit_states[i];
        info->states_changed |= *x != found[GT_WHENS + GT_DISCRETES + i];
        *x = found[GT_WHENS + GT_DISCRETES + i];
    }
    it->now.stale = it->outputs_stale = 1;
    return GT_OK;
}

/* Refuse events that come ever faster, so that the time stands still. */
static gt_status gt_count(gt_instance *it) {
    const double span = it->now.stop_defined ? fmin(GT_CROWDED * (it->now.stop - it->now.start), GT_CROWDED_TIME) : GT_CROWDED;
    if (it->now.time - it->now.events_since > span) {
        it->now.events = 0;
        it->now.events_since = it->now.time;
    }
    if (++it->now.events <= GT_MOST_EVENTS) return GT_OK;
    return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: more than %d events within %.3g s, the last of %s at time = %.9g s: they come ever faster, "
                  "or turn back and forth without end; let what repeats come to rest, as by a condition on its speed, or smooth "
                  "it", GT_NAME, GT_MOST_EVENTS, span, it->last_event ? it->last_event : "what an importer found",
                  it->now.time);
}

/* All that happens at the present instant, in rounds, until no condition becomes true any more. */
static gt_status gt_update(gt_instance *it, gt_event_info *info) {
    int sampled = 0, happened = 0, acted = 1, round;
    const char *actor = NULL;
    double turn = INFINITY, x[GT_ROOM(GT_STATES)];
    gt_status status = GT_OK;
#if GT_DELAYS
    if (!it->cosimulation) status = gt_remember(it);
    if (status == GT_OK && !it->cosimulation) status = gt_begin_past(it);
#endif
    if (status == GT_OK && !it->closing) status = gt_sample(it, &sampled);
#if GT_DELAYS
    if (!it->closing) gt_arrive(it);
#endif
    memset(info, 0, sizeof *info);
    for (round = 0; status == GT_OK && acted; round++) {
        int turned = 0, changed = 0;
        if (round > GT_MOST_ROUNDS)
            return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: after %d rounds at time = %.9g s %s still becomes true: what it does makes itself true "
                          "again; let it do so once, as by a Discrete that says so", GT_NAME, GT_MOST_ROUNDS, it->now.time, it->last_event);
        acted = 0;
        memcpy(x, it->now.x, sizeof x);
        status = gt_agree(it, &turned);
        info->states_changed |= memcmp(x, it->now.x, GT_STATES * sizeof(double)) != 0;
        if (status == GT_OK) status = gt_friction_events(it, &changed);
        if (GT_WHENS && status == GT_OK) status = gt_act(it, info, &acted);
        if (acted) actor = it->last_event;
        happened |= turned || changed || acted;
    }
    if (actor) it->last_event = actor;
    if (GT_GAPS && !it->cosimulation) happened |= 2; /* an importer found an event: where nothing turned it goes on from there */
    if (happened && status == GT_OK) status = gt_count(it);
    if (happened && status == GT_OK) status = gt_slacken(it);
    if (status == GT_OK) status = gt_next_turn(it, &turn);
#if GT_DELAYS
    if (status == GT_OK && !it->cosimulation) status = gt_begin_piece(it);
    if (status == GT_OK && !it->cosimulation) turn = fmin(turn, gt_next_arrival(&it->memory, it->now.time));
#endif
    if (status != GT_OK) return status;
    info->again = sampled || happened & 1;
    info->terminate = it->now.ended != 0;
    info->next = fmin(gt_next_sample(it, INFINITY), turn);
    info->next_defined = info->next < INFINITY;
    return GT_OK;
}

static gt_status gt_set_time(gt_instance *it, double time) {
    if (!isfinite(time))
        return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: found the time %g, expected a finite number in s", GT_NAME, time);
    if (it->now.time != time) it->now.stale = it->outputs_stale = 1;
    it->now.time = it->time = time;
    return GT_OK;
}

static gt_status gt_set_states(gt_instance *it, const double *x) {
    int i;
    for (i = 0; i < GT_STATES; i++)
        if (!isfinite(x[i]))
            return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: found the value %g for the state %s, expected a finite number; the integrator of "
                          "the importing tool may take steps that are too long", GT_NAME, x[i], gt_x_names[i]);
    memcpy(it->now.x, x, GT_STATES * sizeof(double));
    it->now.stale = it->outputs_stale = 1;
    return GT_OK;
}

static gt_status gt_get_states(gt_instance *it, double *x) {
    const gt_status status = gt_present(it);
    memcpy(x, it->now.x, GT_STATES * sizeof(double));
    return status;
}

static void gt_get_nominals(const gt_instance *it, double *nominals) {
    (void)it;
    memcpy(nominals, gt_x_nominals, GT_STATES * sizeof(double));
}
