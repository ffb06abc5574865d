/* One step of Rodas4, a stiffly accurate Rosenbrock method of order 4 (Hairer, Wanner: Solving Ordinary Differential
 * Equations II, section VI.4), for models with explicit time. Jacobian and rate of time are those at the start. */

#define GT_GAMMA 0.25

static gt_status gt_try_step(gt_instance *it, double t, double h, const double *x, double *next, double *error) {
    static const double A[5][5] = {
        {1.544},
        {0.9466785280815826, 0.2557011698983284},
        {3.314825187068521, 2.896124015972201, 0.9986419139977817},
        {1.221224509226641, 6.019134481288629, 12.53708332932087, -0.687886036105895},
        {1.221224509226641, 6.019134481288629, 12.53708332932087, -0.687886036105895, 1},
    };
    static const double C[5][5] = {
        {-5.6688},
        {-2.430093356833875, -0.2063599157091915},
        {-0.1073529058151375, -9.594562251023355, -20.47028614809616},
        {7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160},
        {8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054},
    };
    static const double at[6] = {0, 0.386, 0.21, 0.63, 1, 1}, D[6] = {0.25, -0.1043, 0.1035, -0.0362000000000002, 0, 0};
    double factors[GT_ROOM(GT_STATES * GT_STATES)], *y = it->trial;
    double(*k)[GT_ROOM(GT_STATES)] = it->k;
    int stage, i, j;
    for (i = 0; i < GT_STATES * GT_STATES; i++) factors[i] = -it->jacobian[i];
    for (i = 0; i < GT_STATES; i++) factors[i + i * GT_STATES] += 1 / (h * GT_GAMMA);
    if (GT_STATES && !gt_factor(GT_STATES, factors, it->order, it->rows)) return GT_DISCARD;
    for (stage = 0; stage < 6; stage++) {
        const double *rates = k[6];
        if (stage > 0) {
            for (i = 0; i < GT_STATES; i++) {
                y[i] = x[i];
                for (j = 0; j < stage; j++) y[i] += A[stage - 1][j] * k[j][i];
            }
            if (gt_rates_at(it, t + at[stage] * h, y, k[stage]) != GT_OK) return GT_DISCARD;
            rates = k[stage];
        }
        for (i = 0; i < GT_STATES; i++) {
            double sum = rates[i] + h * D[stage] * it->rate_of_time[i];
            for (j = 0; j < stage; j++) sum += C[stage - 1][j] / h * k[j][i];
            k[stage][i] = sum;
        }
        gt_solve_factored(GT_STATES, factors, it->order, it->rows, k[stage]);
    }
    for (i = 0; i < GT_STATES; i++) {
        next[i] = y[i] + k[5][i];
        error[i] = k[5][i];
    }
    return GT_OK;
}

#define GT_ORDER 4
#define GT_FIRST_RATES 6

/* Rates, Jacobian and rate of time at the present point; the rates are kept in k[6]. */
static gt_status gt_prepare(gt_instance *it) {
    gt_status status = gt_get_rates(it, it->k[6]);
    int j;
    if (status == GT_OK) status = gt_ready(it);
    if (status != GT_OK) return status;
    for (j = -1; j < GT_STATES; j++) {
        gt_clear_direction(it);
        *(j < 0 ? &it->dt : it->dx + j) = 1;
#if GT_DELAYS
        if (j < 0) gt_put_past_rates(it);
#endif
        gt_along(it, 0);
        memcpy(j < 0 ? it->rate_of_time : it->jacobian + j * GT_STATES, it->g, GT_STATES * sizeof(double));
    }
    return GT_OK;
}

static gt_status gt_accepted(gt_instance *it) {
    return gt_prepare(it);
}
