/* The algebraic unknowns: blocks one after another, linear ones outright, others by a damped Newton iteration.
 *
 * A jump from one point to another is followed in small steps where one iteration might land on another
 * way to assemble the mechanism.
 */

#define GT_ITERATIONS 50
#define GT_HALVINGS 12
#define GT_SMALL 1e-11     /* relative size of a Newton step that ends the iteration: the next would be its square */
#define GT_SINGULAR 1e-7   /* relative to the largest coefficient: below, rounding moves a solution by its own root */
#define GT_FAR 0.1         /* size of a first step, relative to nominal + |z|, from which on the way is followed */
#define GT_STEPS_ON_THE_WAY 64

static double gt_norm(int n, const double *values) {
    double sum = 0;
    int i;
    for (i = 0; i < n; i++) sum += values[i] * values[i];
    return sqrt(sum);
}

static void gt_parameters(gt_instance *it) {
    if (it->parameters_stale) {
        gt_fill(it->a, it->c, it->w);
        it->parameters_stale = 0;
        it->factors_stale = 1;
    }
}

static gt_status gt_block_fails(gt_instance *it, const gt_block *block, int quiet, const char *why) {
    char names[400] = "";
    int i;
    if (quiet) return GT_DISCARD;
    for (i = 0; i < block->count; i++) {
        const char *name = gt_z_names[block->first + i];
        if (strlen(names) + strlen(name) + 8 > sizeof names || i == 4) {
            strcat(names, ", ...");
            break;
        }
        if (i) strcat(names, ", ");
        strcat(names, name);
    }
    return gt_say(it, GT_ERROR, GT_LOG_ERROR,
                  "%s: the equations for %s %s at time = %.9g s; %s", GT_NAME, names, why, *it->a[0],
                  block->frictions ? "frictions that stick at once may leave their forces open: keep one on each moving part, or take "
                                     "smooth friction"
                                   : "the pose may be singular or out of reach: keep away from it, or check states, inputs and "
                                     "parameters");
}

static int gt_factor_block(gt_instance *it, const gt_block *block) {
    double *matrix = it->matrices + block->matrix;
    block->jacobian(it->a, matrix, it->w);
    return gt_factor(block->count, matrix, it->pivots + block->first, it->scales + block->first);
}

static void gt_direction(gt_instance *it, const gt_block *block, const double *residual, double *step) {
    int i;
    for (i = 0; i < block->count; i++) step[i] = -residual[i];
    gt_solve_factored(block->count, it->matrices + block->matrix, it->pivots + block->first, it->scales + block->first, step);
}

static double gt_relative(const gt_block *block, const double *z, const double *step) {
    double largest = 0;
    int i;
    for (i = 0; i < block->count; i++)
        largest = fmax(largest, isfinite(step[i]) ? fabs(step[i]) / (gt_z_nominals[block->first + i] + fabs(z[i])) : INFINITY);
    return largest;
}

static int gt_is_singular(const gt_instance *it, const gt_block *block) {
    return !block->linear && gt_regularity(block->count, it->matrices + block->matrix, it->scales + block->first) < GT_SINGULAR;
}

/* A measure with the sign of the determinant that goes to zero as the block becomes singular. A determinant of many
 * rows changes by decades where nothing happens. */
static double gt_measure(const gt_instance *it, const gt_block *block, int sign) {
    return sign * gt_regularity(block->count, it->matrices + block->matrix, it->scales + block->first);
}

/* GT_DISCARD: not found, told nowhere if quiet. direct: give up where the first step is far. */
static gt_status gt_solve_block(gt_instance *it, int number, int quiet, int direct) {
    const gt_block *block = gt_blocks + number;
    double *z = it->now.z + block->first;
    double residual[GT_LARGEST_BLOCK_ROOM], step[GT_LARGEST_BLOCK_ROOM], old[GT_LARGEST_BLOCK_ROOM];
    double size, before, damping;
    int iteration, halving, i, side = 0;
    for (iteration = 0; iteration < GT_ITERATIONS; iteration++) {
        block->residual(it->a, residual, it->w);
        side = gt_factor_block(it, block);
        if (!side) return gt_block_fails(it, block, quiet, "do not determine them (they depend on each other)");
        gt_direction(it, block, residual, step);
        size = gt_relative(block, z, step);
        if (!(size < INFINITY)) return gt_block_fails(it, block, quiet, "have no finite solution");
        if (direct && iteration == 0 && !block->linear && size > GT_FAR) return GT_DISCARD;
        if (block->linear || size <= GT_SMALL) {
            if (gt_is_singular(it, block))
                return gt_block_fails(it, block, quiet, "do not determine them (they depend on each other)");
            for (i = 0; i < block->count; i++) z[i] += step[i];
            if (block->linear && block->count > 1) { /* one refinement: elimination alone costs three digits of many unknowns */
                block->residual(it->a, residual, it->w);
                gt_direction(it, block, residual, step);
                for (i = 0; i < block->count; i++) z[i] += step[i];
            }
            it->now.sides[number] = gt_measure(it, block, side);
            return GT_OK;
        }
        before = gt_norm(block->count, residual);
        memcpy(old, z, block->count * sizeof(double));
        for (damping = 1, halving = 0; halving < GT_HALVINGS; halving++, damping /= 2) {
            for (i = 0; i < block->count; i++) z[i] = old[i] + damping * step[i];
            block->residual(it->a, residual, it->w);
            if (gt_norm(block->count, residual) < before) break; /* false for NaN */
        }
        if (halving == GT_HALVINGS) {
            /* rounding alone keeps the residual from falling where the step is that small */
            if (size > 1e-8 || gt_is_singular(it, block))
                return gt_block_fails(it, block, quiet, "could not be solved");
            memcpy(z, old, block->count * sizeof(double));
            it->now.sides[number] = gt_measure(it, block, side);
            return GT_OK;
        }
    }
    return gt_block_fails(it, block, quiet, "could not be solved");
}

static gt_status gt_solve_blocks(gt_instance *it, int quiet, int direct) {
    int number;
    for (number = 0; number < GT_BLOCKS; number++) {
        const gt_status status = gt_solve_block(it, number, quiet, direct);
        if (status != GT_OK) return status;
    }
    it->factors_stale = 1; /* the last iterate moved behind them */
    return GT_OK;
}

static void gt_between(int n, double share, const double *from, const double *to, double *found) {
    int i;
    for (i = 0; i < n; i++) found[i] = share == 1 ? to[i] : from[i] + share * (to[i] - from[i]);
}

/* From the last solved point to the present one in steps. */
static gt_status gt_follow(gt_instance *it) {
    double x[GT_ROOM(GT_STATES)], u[GT_ROOM(GT_KNOWN)], time;
    const double *const there[3] = {it->a[0], it->a[1], it->a[2]};
    gt_status status = GT_OK;
    int step;
    memcpy(it->now.z, it->now.solved_z, sizeof it->now.z);
    it->a[0] = &time;
    it->a[1] = x;
    it->a[2] = u;
    for (step = 1; step <= GT_STEPS_ON_THE_WAY && status == GT_OK; step++) {
        const double share = (double)step / GT_STEPS_ON_THE_WAY;
        gt_between(1, share, &it->now.solved_time, there[0], &time);
        gt_between(GT_STATES, share, it->now.solved_x, there[1], x);
        gt_between(GT_KNOWN, share, it->now.solved_u, there[2], u);
        if (step == GT_STEPS_ON_THE_WAY) memcpy(it->a, there, sizeof there);
        status = gt_solve_blocks(it, step < GT_STEPS_ON_THE_WAY, 0);
        if (status == GT_DISCARD) { /* say it of the point that was asked for */
            memcpy(it->a, there, sizeof there);
            status = gt_solve_blocks(it, 0, 0);
            if (status == GT_OK) status = gt_block_fails(it, gt_blocks, 0, "cannot be followed from the last solution");
        }
    }
    memcpy(it->a, there, sizeof there);
    return status;
}

/* Solve at the point that it->a shows, from the z of the last one; quiet: failures are not logged. */
static gt_status gt_solve(gt_instance *it, int quiet) {
    double z[GT_ROOM(GT_ALGEBRAICS)];
    gt_status status;
    gt_parameters(it);
    if (GT_BLOCKS == 0) return GT_OK;
    memcpy(z, it->now.z, sizeof z);
    status = gt_solve_blocks(it, 1, 1);
    if (status == GT_OK) return status;
    memcpy(it->now.z, z, sizeof z);
    if (!quiet) return gt_follow(it);
    status = gt_solve_blocks(it, 1, 0);
    if (status != GT_OK) memcpy(it->now.z, z, sizeof z);
    return status;
}

/* Make everything belong to the present states, inputs and parameters. */
static gt_status gt_refresh(gt_instance *it) {
    gt_status status;
    gt_parameters(it);
    if (!it->now.stale) return GT_OK; /* a restored z is kept as it is, to the last bit */
    gt_point_at(it, &it->now.time, it->now.x);
#if GT_DELAYS
    gt_put_past(it, it->now.time, it->now.u);
#endif
    status = gt_solve(it, 0);
#if GT_DELAYS
    if (status == GT_OK && !it->memory.begun) status = gt_settle_past(it);
#endif
    if (status != GT_OK) {
        memcpy(it->now.z, it->now.solved_z, sizeof it->now.z); /* so that the next try does not begin astray */
        return status;
    }
    it->now.stale = 0;
    it->outputs_stale = it->factors_stale = 1;
    if (GT_BLOCKS == 0) return GT_OK;
    it->now.solved_time = it->now.time;
    memcpy(it->now.solved_x, it->now.x, sizeof it->now.x);
    memcpy(it->now.solved_u, it->now.u, sizeof it->now.u);
    memcpy(it->now.solved_z, it->now.z, sizeof it->now.z);
    return GT_OK;
}

static gt_status gt_all_finite(gt_instance *it, int n, const double *values, const char *const *names, const char *what) {
    int i;
    for (i = 0; i < n; i++)
        if (!isfinite(values[i]))
            return gt_say(it, GT_ERROR, GT_LOG_ERROR,
                          "%s: %s%s is not a finite number at time = %.9g s; the model has no solution there (a pose out of "
                          "reach or singular): keep away from it", GT_NAME, what, names[i], *it->a[0]);
    return GT_OK;
}

/* Before initialisation ends, the states are those that start values and initial equations give. There, and between two
 * steps, modes follow what is set. */
static gt_status gt_present(gt_instance *it) {
    const int starting = it->mode == GT_INITIALIZATION;
    gt_status status = GT_OK;
    int changed = 1, round;
    if (!starting && !(GT_TURNS && it->mode == GT_STEP && !it->stepping && it->now.stale)) return GT_OK;
    for (round = 0; round < GT_ITERATIONS && changed && status == GT_OK; round++) {
        const int stale = it->now.stale || it->now.starts_stale;
        changed = 0;
        if (starting) status = gt_initial_equations(it);
        it->resting = starting;
        if (GT_TURNS && stale && status == GT_OK) status = gt_agree(it, &changed);
        it->resting = 0;
        if (changed && starting) it->now.stale = it->outputs_stale = 1;
    }
    return status;
}

/* Rates of the states at the present point. */
static gt_status gt_get_rates(gt_instance *it, double *rates) {
    gt_status status = gt_present(it);
    if (status == GT_OK) status = gt_refresh(it);
    if (status != GT_OK) return status;
    gt_rates(it->a, rates, it->w);
    return gt_all_finite(it, GT_STATES, rates, gt_x_names, "the derivative of ");
}

/* Rates at a trial point of an integrator; GT_DISCARD where there are none. */
static gt_status gt_rates_at(gt_instance *it, double time, const double *x, double *rates) {
    double sum = 0;
    int i;
#if GT_DELAYS
    double late[GT_DELAYS];
    memcpy(late, it->now.u + GT_FIRST_DELAY, sizeof late);
    gt_put_past(it, time, it->now.u);
#endif
    gt_point_at(it, &time, x);
    if (GT_BLOCKS && (gt_solve(it, 1) != GT_OK || gt_other_side(it) >= 0)) {
#if GT_DELAYS
        memcpy(it->now.u + GT_FIRST_DELAY, late, sizeof late);
#endif
        gt_point_at(it, &it->now.time, it->now.x);
        return GT_DISCARD;
    }
    gt_rates(it->a, rates, it->w);
#if GT_DELAYS
    memcpy(it->now.u + GT_FIRST_DELAY, late, sizeof late);
#endif
    gt_point_at(it, &it->now.time, it->now.x);
    for (i = 0; i < GT_STATES; i++) sum += rates[i] - rates[i]; /* NaN unless all are finite */
    return sum == 0 ? GT_OK : GT_DISCARD;
}
