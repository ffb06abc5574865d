/* Sampled variables, which are renewed at multiples of their periods. */

#define GT_ON_TIME 1e-6      /* of a period: instants that close are the same, also where masters add up their steps */

static double gt_next_tick(const gt_instance *it, int clock, const double *periods) {
    return it->now.start + it->now.ticks[clock] * periods[clock];
}

static gt_status gt_check_clocks(gt_instance *it) {
    double periods[GT_ROOM(GT_CLOCKS)];
    int i;
    if (GT_CLOCKS) gt_periods(it->a, periods, it->w);
    for (i = 0; i < GT_CLOCKS; i++)
        if (!(periods[i] > 0) || !isfinite(periods[i]))
            return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: the sampling period of %s is %g s, expected one above zero", GT_NAME,
                          gt_clock_names[i], periods[i]);
    return GT_OK;
}

static double gt_on_time(double time, double period) {
    return GT_ON_TIME * period + 4.5e-16 * fabs(time);
}

/* The earliest sampling instant to come that is before `end`; INFINITY if there is none. */
static double gt_next_sample(gt_instance *it, double end) {
    double periods[GT_ROOM(GT_CLOCKS)], next = INFINITY;
    int i;
    if (GT_CLOCKS) gt_periods(it->a, periods, it->w);
    for (i = 0; i < GT_CLOCKS; i++) {
        const double tick = gt_next_tick(it, i, periods);
        if (tick < next && tick + gt_on_time(tick, periods[i]) < end) next = tick;
    }
    return next;
}

/* Which clocks tick now; whether any does. */
static int gt_find_due(gt_instance *it, double *periods, int *due) {
    int i, any = 0;
    if (!GT_CLOCKS) return 0;
    gt_parameters(it);
    gt_periods(it->a, periods, it->w);
    for (i = 0; i < GT_CLOCKS; i++) {
        due[i] = gt_next_tick(it, i, periods) <= it->now.time + gt_on_time(it->now.time, periods[i]);
        any |= due[i];
    }
    return any;
}

/* Take the samples that are due; all updates use the values before the instant, with the inputs of the instant. */
static gt_status gt_sample(gt_instance *it, int *sampled) {
    double periods[GT_ROOM(GT_CLOCKS)], held[GT_ROOM(GT_HELD_COUNT)];
    int due[GT_ROOM(GT_CLOCKS)], changed, i;
    gt_status status;
    *sampled = gt_find_due(it, periods, due);
    if (!*sampled) return GT_OK;
    it->sampling = 1;
    status = gt_agree(it, &changed);
    it->sampling = 0;
    if (status == GT_OK) status = gt_refresh(it);
    if (status != GT_OK) return status;
#ifdef GT_CONTROLLER
    controller_step(&it->now.controller, it->now.u, held);
#else
    gt_samples(it->a, held, it->w);
#endif
    for (i = 0; i < GT_HELD_COUNT; i++)
        if (due[gt_held_clocks[i]] && !isfinite(held[i]))
            return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: the sample of %s is not a finite number at time = %.9g s", GT_NAME,
                          gt_held_names[i], it->now.time);
    for (i = 0; i < GT_HELD_COUNT; i++)
        if (due[gt_held_clocks[i]]) it->now.u[GT_INPUTS + i] = held[i];
    for (i = 0; i < GT_CLOCKS; i++)
        if (due[i]) {
            const double gone = it->now.time + gt_on_time(it->now.time, periods[i]) - it->now.start;
            it->now.ticks[i] = fmax(it->now.ticks[i], floor(gone / periods[i])) + 1;
            it->last_event = gt_clock_names[i];
        }
    it->now.stale = it->outputs_stale = 1;
    return GT_OK;
}
