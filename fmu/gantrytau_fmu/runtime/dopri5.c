/* One step of Dormand and Prince's method of order 5 (Hairer, Norsett, Wanner: Solving Ordinary Differential
 * Equations I, table II.5.2). k[0] holds the rates at the start. */

static gt_status gt_try_step(gt_instance *it, double t, double h, const double *x, double *next, double *error) {
    double(*k)[GT_ROOM(GT_STATES)] = it->k;
    double *y = it->trial;
    int i;
#define GT_STAGE(at, expression, to)                                              \
    for (i = 0; i < GT_STATES; i++) y[i] = x[i] + h * (expression);               \
    if (gt_rates_at(it, t + (at) * h, y, k[to]) != GT_OK) return GT_DISCARD
    GT_STAGE(1. / 5, k[0][i] * (1. / 5), 1);
    GT_STAGE(3. / 10, k[0][i] * (3. / 40) + k[1][i] * (9. / 40), 2);
    GT_STAGE(4. / 5, k[0][i] * (44. / 45) - k[1][i] * (56. / 15) + k[2][i] * (32. / 9), 3);
    GT_STAGE(8. / 9, k[0][i] * (19372. / 6561) - k[1][i] * (25360. / 2187) + k[2][i] * (64448. / 6561) - k[3][i] * (212. / 729), 4);
    GT_STAGE(1, k[0][i] * (9017. / 3168) - k[1][i] * (355. / 33) + k[2][i] * (46732. / 5247) + k[3][i] * (49. / 176) -
                    k[4][i] * (5103. / 18656), 5);
#undef GT_STAGE
    for (i = 0; i < GT_STATES; i++)
        next[i] = x[i] + h * (k[0][i] * (35. / 384) + k[2][i] * (500. / 1113) + k[3][i] * (125. / 192) - k[4][i] * (2187. / 6784) +
                              k[5][i] * (11. / 84));
    if (gt_rates_at(it, t + h, next, k[6]) != GT_OK) return GT_DISCARD;
    for (i = 0; i < GT_STATES; i++)
        error[i] = h * (k[0][i] * (71. / 57600) - k[2][i] * (71. / 16695) + k[3][i] * (71. / 1920) - k[4][i] * (17253. / 339200) +
                        k[5][i] * (22. / 525) - k[6][i] * (1. / 40));
    return GT_OK;
}

#define GT_ORDER 5
#define GT_FIRST_RATES 0

static gt_status gt_prepare(gt_instance *it) {
    return gt_get_rates(it, it->k[0]);
}

/* After an accepted step the last rates are the first of the next. */
static gt_status gt_accepted(gt_instance *it) {
    memcpy(it->k[0], it->k[6], sizeof it->k[0]);
    return GT_OK;
}
