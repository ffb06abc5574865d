/* Initialisation: the states that initial equations determine, modes, first samples. */

#define GT_INITIAL_ITERATIONS 30
#define GT_SMOOTH 3e-5
#define GT_SMALL_PIVOT 1e-9 /* of its usual size: below, seven digits and more of what is divided by it are lost */

/* The arguments have been checked. */
static void gt_setup(gt_instance *it, int tolerance_defined, double tolerance, double start, int stop_defined, double stop) {
    it->now.start = it->now.time = it->time = start;
    it->now.stop = stop;
    it->now.stop_defined = stop_defined;
    if (tolerance_defined) it->now.tolerance = fmax(tolerance, 1e-12);
    it->now.ready = 1;
    it->now.stale = it->outputs_stale = 1;
}

/* Residuals of the initial equations at the present states; GT_DISCARD where there are none. */
static gt_status gt_initial_residual(gt_instance *it, double *residual) {
    int i;
    it->now.stale = 1;
    gt_point_at(it, &it->now.time, it->now.x);
    if (gt_solve(it, 0) != GT_OK) return GT_ERROR;
#if GT_DELAYS
    if (gt_settle_past(it) != GT_OK) return GT_ERROR;
#endif
    gt_initial(it->a, residual, it->w);
    for (i = 0; i < GT_INITIAL; i++)
        if (!isfinite(residual[i])) return GT_DISCARD;
    return GT_OK;
}

/* Newton's method with differences for the Jacobian: the residuals are exact, so the solution is. */
static gt_status gt_initial_equations(gt_instance *it) {
    double residual[GT_ROOM(GT_INITIAL)], moved[GT_ROOM(GT_INITIAL)], matrix[GT_ROOM(GT_INITIAL * GT_INITIAL)];
    double scales[GT_ROOM(GT_INITIAL)];
    int pivots[GT_ROOM(GT_INITIAL)], iteration, i, j;
    double guess[GT_ROOM(GT_STATES)], size = INFINITY;
    gt_status status;
    gt_start_values(it);
    if (GT_INITIAL == 0 || it->now.initialized || !it->now.stale) return GT_OK;
    memcpy(guess, it->now.x, sizeof guess);
    for (iteration = 0; iteration < GT_INITIAL_ITERATIONS; iteration++) {
        if (gt_initial_residual(it, residual) != GT_OK) break;
        if (size <= 1e-12) return gt_refresh(it);
        for (j = 0; j < GT_INITIAL; j++) {
            double *x = it->now.x + gt_initial_states[j];
            const double kept = *x, step = 1e-6 * (1 + fabs(kept));
            *x = kept + step;
            status = gt_initial_residual(it, moved);
            *x = kept;
            if (status != GT_OK) break;
            for (i = 0; i < GT_INITIAL; i++) matrix[i + j * GT_INITIAL] = (moved[i] - residual[i]) / step;
        }
        if (j < GT_INITIAL || !gt_factor(GT_INITIAL, matrix, pivots, scales)) break;
        gt_solve_factored(GT_INITIAL, matrix, pivots, scales, residual);
        for (size = 0, j = 0; j < GT_INITIAL; j++) {
            double *x = it->now.x + gt_initial_states[j];
            *x -= residual[j];
            size = fmax(size, fabs(residual[j]) / (1 + fabs(*x)));
        }
    }
    memcpy(it->now.x, guess, sizeof guess);
    return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: the initial equations for %s%s could not be solved at time = %.9g s; check start values, "
                  "inputs and parameters", GT_NAME, gt_x_names[gt_initial_states[0]], GT_INITIAL > 1 ? " and others" : "", it->now.time);
}

/* Whether the rates are about the same a millionth beside the present states. */
static int gt_is_smooth(gt_instance *it) {
    const gt_state kept = it->now;
    double here[GT_ROOM(GT_STATES)], beside[GT_ROOM(GT_STATES)], largest = 0, apart = 0;
    int i, found;
    gt_rates(it->a, here, it->w);
    for (i = 0; i < GT_STATES; i++) it->now.x[i] += 1e-6 * (1 + fabs(kept.x[i]));
    it->now.stale = 1;
    found = gt_refresh(it) == GT_OK;
    if (found) gt_rates(it->a, beside, it->w);
    it->now = kept;
    it->outputs_stale = it->factors_stale = 1;
    gt_point_at(it, &it->now.time, it->now.x);
    for (i = 0; i < GT_STATES && found; i++) {
        largest = fmax(largest, fmax(fabs(here[i]), fabs(beside[i])));
        apart = fabs(here[i] - beside[i]) <= apart ? apart : fabs(here[i] - beside[i]); /* NaN stays */
    }
    return found && apart <= GT_SMOOTH * (1 + largest);
}

/* Equations solved for their unknowns divide by pivots, which were chosen at the start of the export. */
static gt_status gt_check_pivots(gt_instance *it) {
    const double *const there[3] = {it->a[1], it->a[2], it->a[3]};
    double found[GT_ROOM(GT_PIVOTS)], usual[GT_ROOM(GT_PIVOTS)];
    int i;
    if (GT_PIVOTS == 0) return GT_OK;
    gt_pivots(it->a, found, it->w);
    it->a[1] = gt_start_x;
    it->a[2] = gt_start_u;
    it->a[3] = gt_start_z;
    gt_pivots(it->a, usual, it->w);
    memcpy(it->a + 1, there, sizeof there);
    for (i = 0; i < GT_PIVOTS; i++)
        if (fabs(found[i]) < GT_SMALL_PIVOT * fabs(usual[i]) && !gt_is_smooth(it))
            return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: at this start the equations would divide by zero because of %s; they are arranged "
                          "for the start of the export: start a millionth away, or export the model with this start", GT_NAME,
                          gt_pivot_names[i]);
    return GT_OK;
}

static gt_status gt_initialize(gt_instance *it) {
    gt_event_info info;
    double rates[GT_ROOM(GT_STATES)];
    gt_status status = gt_present(it);
#if GT_DELAYS
    if (status == GT_OK) status = gt_check_delays(it);
#endif
    if (status == GT_OK) status = gt_refresh(it);
    if (status == GT_OK) status = gt_check_pivots(it);
    if (status != GT_OK) return status;
    it->now.initialized = 1;
    gt_keep_point(it);
    memset(it->now.side_rates, 0, sizeof it->now.side_rates);
    if (GT_ROOTS && !it->cosimulation) gt_root_rates(it, 1e-3, it->now.kept_rates, it->now.root_rates);
    memset(it->now.ticks, 0, sizeof it->now.ticks);
    status = gt_check_clocks(it);
    if (status == GT_OK) status = gt_begin_modes(it);
    if (status == GT_OK) status = gt_begin_whens(it);
    if (status == GT_OK && !it->cosimulation) { /* samples are taken in the first event mode */
        status = gt_get_rates(it, rates);
        if (status == GT_OK) gt_tell_limits(it);
        return status;
    }
    gt_keep_before(it, 0);
    it->now.waiting = GT_CLOCKS > 0;
    if (status == GT_OK) status = gt_update(it, &info);
    if (status == GT_OK) status = gt_get_rates(it, rates);
    if (status == GT_OK) gt_tell_limits(it);
    return status;
}
