/* Exact directional derivatives; the implicit unknowns follow by the implicit function theorem. */

/* g: rates of the states, residuals of the blocks, and outputs, in the direction of dt, dx, du, dz, dp. */
static void gt_slopes(gt_instance *it, int parameters) {
    double more[GT_ROOM(GT_SLOPES)];
    int i;
    gt_forward(it->a, it->g, it->w);
    if (!parameters) return;
    gt_by_parameters(it->a, more, it->w);
    for (i = 0; i < GT_SLOPES; i++) it->g[i] += more[i];
}

/* Factors of all blocks at the present point. */
static gt_status gt_factors(gt_instance *it) {
    int number;
    for (number = 0; number < GT_BLOCKS; number++)
        if (!gt_factor_block(it, gt_blocks + number))
            return gt_block_fails(it, gt_blocks + number, 0, "do not determine them (they depend on each other)");
    return GT_OK;
}

/* dz that keeps all residuals at zero, then g; blocks must be factored. */
static void gt_along_states(gt_instance *it, int parameters) {
    double step[GT_LARGEST_BLOCK_ROOM];
    int number;
    memset(it->dz, 0, sizeof it->dz);
    for (number = 0; number < GT_BLOCKS; number++) {
        const gt_block *block = gt_blocks + number;
        gt_slopes(it, parameters);
        gt_direction(it, block, it->g + GT_STATES + block->first, step);
        memcpy(it->dz + block->first, step, block->count * sizeof(double));
    }
    gt_slopes(it, parameters);
}

static void gt_clear_direction(gt_instance *it) {
    it->dt = 0;
    memset(it->dx, 0, sizeof it->dx);
    memset(it->du, 0, sizeof it->du);
    memset(it->dp, 0, sizeof it->dp);
}

/* Before initialisation ends, the states that initial equations determine are unknowns. */
static int gt_starts_follow(const gt_instance *it) {
    return GT_INITIAL > 0 && it->mode == GT_INITIALIZATION;
}

static gt_status gt_initial_factors(gt_instance *it) {
    int j;
    for (j = 0; j < GT_INITIAL; j++) {
        gt_clear_direction(it);
        it->dx[gt_initial_states[j]] = 1;
        gt_along_states(it, 0);
        gt_initial_slopes(it->a, it->initial + j * GT_INITIAL, it->w);
    }
    if (gt_factor(GT_INITIAL, it->initial, it->initial_pivots, it->initial_scales)) return GT_OK;
    return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: the initial equations do not determine %s%s at time = %.9g s; check start values, inputs "
                  "and parameters", GT_NAME, gt_x_names[gt_initial_states[0]], GT_INITIAL > 1 ? " and others" : "", it->now.time);
}

/* g in the direction that is seeded; as long as initial equations hold, dx that keeps them at zero as well. */
static void gt_along(gt_instance *it, int parameters) {
    double step[GT_ROOM(GT_INITIAL)];
    int i;
    gt_along_states(it, parameters);
    if (!gt_starts_follow(it)) return;
    gt_initial_slopes(it->a, step, it->w);
    gt_solve_factored(GT_INITIAL, it->initial, it->initial_pivots, it->initial_scales, step);
    for (i = 0; i < GT_INITIAL; i++) it->dx[gt_initial_states[i]] = -step[i];
    gt_along_states(it, parameters);
}

static gt_status gt_ready(gt_instance *it) {
    gt_status status = gt_present(it);
    if (status == GT_OK) status = gt_refresh(it);
    if (status == GT_OK && it->factors_stale) {
        status = gt_factors(it);
        it->factors_stale = status != GT_OK;
    }
    if (status == GT_OK && gt_starts_follow(it)) status = gt_initial_factors(it);
    return status;
}

static gt_status gt_is_unknown(gt_instance *it, unsigned reference) {
    gt_status status = gt_known_reference(it, reference);
    if (status != GT_OK) return status;
    switch ((gt_kind)gt_variables[reference].kind) {
    case GT_DERIVATIVE: case GT_OUTPUT: case GT_STATE: case GT_HELD: case GT_CONSTANT: return GT_OK;
    default: return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: %s is no unknown, expected an output or the derivative of a state", GT_NAME,
                           gt_name(reference));
    }
}

/* The place of a known in the direction; NULL with a log line if it is none. */
static double *gt_seed(gt_instance *it, unsigned reference) {
    if (gt_known_reference(it, reference) != GT_OK) return NULL;
    switch ((gt_kind)gt_variables[reference].kind) {
    case GT_TIME: return &it->dt;
    case GT_STATE:
        if (!gt_variables[reference].fixed || !gt_starts_follow(it)) return it->dx + gt_variables[reference].index;
        gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: %s is no known before initialisation ends, for it follows from initial equations; take "
               "what they depend on", GT_NAME, gt_name(reference));
        return NULL;
    case GT_INPUT: case GT_HELD: return it->du + gt_variables[reference].index;
    case GT_PARAMETER: return it->dp + gt_variables[reference].index;
    default:
        gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: %s is no known, expected an input, a state or a parameter", GT_NAME, gt_name(reference));
        return NULL;
    }
}

static double gt_slope(const gt_instance *it, unsigned reference) {
    const gt_variable *variable = gt_variables + reference;
    switch ((gt_kind)variable->kind) {
    case GT_DERIVATIVE: return it->g[variable->index];
    case GT_OUTPUT: return it->g[GT_STATES + GT_ALGEBRAICS + variable->index];
    case GT_STATE: return it->dx[variable->index];
    default: return 0;
    }
}

static gt_status gt_check_unknowns(gt_instance *it, const unsigned *unknown, size_t n) {
    size_t i;
    for (i = 0; i < n; i++)
        if (gt_is_unknown(it, unknown[i]) != GT_OK) return GT_ERROR;
    return GT_OK;
}

static gt_status gt_has_slope(gt_instance *it, const char *of, unsigned reference, double slope) {
    if (isfinite(slope)) return GT_OK;
    return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: the derivative %s %s is not a finite number at time = %.9g s; the model has none there (a "
                  "pose out of reach or singular), or the seed is too large", GT_NAME, of, gt_name(reference), it->now.time);
}

static gt_status gt_directional(gt_instance *it, const unsigned *unknown, size_t n, const unsigned *known, size_t m,
                                const double *d_known, double *d_unknown) {
    int parameters = 0;
    size_t i;
    if (gt_check_unknowns(it, unknown, n) != GT_OK || gt_ready(it) != GT_OK) return GT_ERROR;
    gt_clear_direction(it);
    for (i = 0; i < m; i++) {
        double *seed = gt_seed(it, known[i]);
        if (!seed) return GT_ERROR;
        if (!isfinite(d_known[i]))
            return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: found the seed %g for %s, expected a finite number", GT_NAME, d_known[i],
                          gt_name(known[i]));
        *seed += d_known[i];
        parameters |= gt_variables[known[i]].kind == GT_PARAMETER;
    }
    gt_along(it, parameters);
    for (i = 0; i < n; i++) {
        d_unknown[i] = gt_slope(it, unknown[i]);
        if (gt_has_slope(it, "of", unknown[i], d_unknown[i]) != GT_OK) return GT_ERROR;
    }
    return GT_OK;
}

/* The transposed product, one column after another: as exact, and no code of its own. */
static gt_status gt_adjoint(gt_instance *it, const unsigned *unknown, size_t n, const unsigned *known, size_t m,
                            const double *d_unknown, double *d_known) {
    size_t i, j;
    if (gt_check_unknowns(it, unknown, n) != GT_OK || gt_ready(it) != GT_OK) return GT_ERROR;
    for (i = 0; i < n; i++)
        if (!isfinite(d_unknown[i]))
            return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: found the seed %g for %s, expected a finite number", GT_NAME, d_unknown[i],
                          gt_name(unknown[i]));
    for (j = 0; j < m; j++) {
        double *seed, sum = 0;
        gt_clear_direction(it);
        seed = gt_seed(it, known[j]);
        if (!seed) return GT_ERROR;
        *seed = 1;
        gt_along(it, gt_variables[known[j]].kind == GT_PARAMETER);
        for (i = 0; i < n; i++) sum += d_unknown[i] * gt_slope(it, unknown[i]);
        d_known[j] = sum;
        if (gt_has_slope(it, "by", known[j], sum) != GT_OK) return GT_ERROR;
    }
    return GT_OK;
}
