/* How the past is kept for delays: a place at the end of each step, two where something is not smooth. */
#if GT_DELAYS

#define GT_LEAST_APART 1e-9   /* of the shortest delay: places are laid no closer */
#define GT_DENSE 1e-3         /* of the longest delay: places that are closer go where they are not needed */
#define GT_JUMP_OF_PAST 1e-9  /* of the largest value */

/* Values and rates along the motion of what delays look back at, at a point whose delayed values move at `late` rates. */
static gt_status gt_along_past(gt_instance *it, double time, const double *x, const double *u, const double *late, double *slopes,
                               double *values, double *rates) {
    gt_status status;
    it->a[0] = &time;
    it->a[1] = x;
    it->a[2] = u;
    status = gt_solve(it, 1);
    if (GT_BLOCKS && status == GT_OK) status = gt_factors(it);
    if (status == GT_OK) {
        gt_rates(it->a, slopes, it->w);
        gt_clear_direction(it);
        it->dt = 1;
        memcpy(it->dx, slopes, GT_STATES * sizeof(double));
        memcpy(it->du + GT_FIRST_DELAY, late, GT_DELAYS * sizeof(double));
        if (GT_BLOCKS) gt_along_states(it, 0);
        gt_past(it->a, values, it->w);
        gt_past_rates(it->a, rates, it->w);
    }
    it->a[2] = it->now.u;
    gt_point_at(it, &it->now.time, it->now.x);
    it->factors_stale = 1;
    return status;
}

/* The place of the present point into it->place; second rates are differences along the motion. */
static gt_status gt_find_place(gt_instance *it) {
    double slopes[GT_ROOM(GT_STATES)], there[GT_ROOM(GT_STATES)], x[GT_ROOM(GT_STATES)], u[GT_ROOM(GT_KNOWN)], z[GT_ROOM(GT_ALGEBRAICS)];
    double sides[GT_ROOM(GT_SIDES)], values[GT_DELAYS], rates[2][GT_DELAYS], late[GT_DELAYS], now[GT_DELAYS][3];
    const double delta = gt_small_time(it->now.time, it->memory.shortest);
    gt_status status = gt_refresh(it);
    int d, i, side;
    if (status != GT_OK) return status;
    memcpy(z, it->now.z, sizeof z);
    memcpy(sides, it->now.sides, sizeof sides);
    for (d = 0; d < GT_DELAYS; d++) {
        gt_recall_one(&it->memory, d, it->now.time, now[d]);
        late[d] = now[d][1];
    }
    status = gt_along_past(it, it->now.time, it->now.x, it->now.u, late, slopes, values, rates[0]);
    for (d = 0; d < GT_DELAYS && status == GT_OK; d++) {
        it->place[d][0] = values[d];
        it->place[d][1] = rates[0][d];
    }
    memcpy(u, it->now.u, sizeof u);
    for (side = 0; side < 2 && status == GT_OK; side++) {
        const double way = side ? delta : -delta;
        for (i = 0; i < GT_STATES; i++) x[i] = it->now.x[i] + way * slopes[i];
        for (d = 0; d < GT_DELAYS; d++) {
            u[GT_FIRST_DELAY + d] = it->now.u[GT_FIRST_DELAY + d] + way * now[d][1];
            late[d] = now[d][1] + way * now[d][2];
        }
        status = gt_along_past(it, it->now.time + way, x, u, late, there, values, rates[side]);
    }
    memcpy(it->now.z, z, sizeof z);
    memcpy(it->now.sides, sides, sizeof sides);
    for (d = 0; d < GT_DELAYS && status == GT_OK; d++) {
        it->place[d][2] = (rates[1][d] - rates[0][d]) / (2 * delta);
        for (i = 0; i < 3; i++)
            if (!isfinite(it->place[d][i]))
                return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: what %s looks back at has no finite %s at time = %.9g s, expected a smooth "
                              "motion between events; keep away from it", GT_NAME, gt_delay_names[d],
                              i == 0 ? "value" : i == 1 ? "rate" : "second rate", it->now.time);
    }
    return status;
}

/* Whether an interval of that length from a place to it->place is too long for the polynomial between. The cubic and the
 * quintic differ in the middle; the error of the latter is about the 3/2 power. */
static int gt_far_apart(const gt_instance *it, int from, double length) {
    const gt_memory *memory = &it->memory;
    int d, far = 0;
    for (d = 0; d < GT_DELAYS; d++) {
        const double *begin = memory->kept[gt_kept_at(memory, from)][d], *end = it->place[d];
        const double largest = fmax(memory->sizes[d], fabs(end[0]));
        const double apart = fabs(length * length * (begin[2] + end[2]) - 2 * length * (end[1] - begin[1])) / 64;
        far |= largest > 0 && pow(apart / largest, 1.5) > it->now.tolerance;
    }
    return far;
}

/* Whether the last place is not needed between the one before it and it->place: steps may be far shorter than delays. */
static int gt_is_spare(const gt_instance *it) {
    const gt_memory *memory = &it->memory;
    const int last = gt_kept_at(memory, memory->count - 1);
    double before, length;
    if (memory->count < 2 || memory->left[last] || memory->straight[last]) return 0;
    if (memcmp(memory->u, it->now.u, GT_INPUTS * sizeof(double))) return 0;
    before = gt_time_kept(memory, memory->count - 2);
    length = it->now.time - before;
    return before < memory->t[last] && length < GT_DENSE * memory->longest && !gt_far_apart(it, memory->count - 2, length);
}

/* Keep it->place. left: how often what is not smooth there travels on; again: it stands beside the last. */
static gt_status gt_keep_place(gt_instance *it, int left, int again) {
    gt_memory *memory = &it->memory;
    const double old = it->now.time - memory->longest - 3 * gt_one_time(memory, it->now.time);
    const int last = gt_kept_at(memory, memory->count - 1 + (memory->count == 0));
    const int twice = again && memory->count > 1 && gt_time_kept(memory, memory->count - 2) == memory->t[last];
    int here, d;
    if (!again && left == 0 && gt_is_spare(it)) memory->count--;
    while (memory->count > 2 && gt_time_kept(memory, 1) < old) {
        memory->oldest = (memory->oldest + 1) % GT_MEMORY;
        memory->count--;
    }
    if (memory->count == GT_MEMORY) {
        for (d = 0; d < GT_DELAYS - 1 && memory->delays[d] < memory->longest; d++) {}
        return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: found more than %d places within the %.6g s of %s at time = %.9g s, where steps end or "
                      "something jumps; take a larger tolerance, fewer jumps of inputs and events, or a shorter delay", GT_NAME, GT_MEMORY,
                      memory->longest, gt_delay_names[d], it->now.time);
    }
    here = twice ? last : gt_kept_at(memory, memory->count);
    if (twice && memory->left[here] > left) left = memory->left[here];
    memory->t[here] = again && memory->count ? memory->t[last] : it->now.time;
    memory->left[here] = left;
    memory->straight[here] = !again && memory->count && memcmp(memory->u, it->now.u, GT_INPUTS * sizeof(double));
    memcpy(memory->kept[here], it->place, sizeof it->place);
    if (!twice) memory->count++;
    for (d = 0; d < GT_DELAYS; d++) memory->sizes[d] = fmax(memory->sizes[d], fabs(it->place[d][0]));
    memcpy(memory->u, it->now.u, GT_FIRST_DELAY * sizeof(double));
    memcpy(memory->x, it->now.x, GT_STATES * sizeof(double));
    memcpy(memory->p, it->now.p, GT_PARAMETERS * sizeof(double));
    memcpy(memory->m, it->now.m, GT_MODES * sizeof(double));
    return GT_OK;
}

/* Whether the step of that size that leads from (t, x) to the present point, whose place is found, is too long for the
 * polynomial between: then back. */
static int gt_too_wide(gt_instance *it, double t, const double *x, double size, gt_status *status) {
    const gt_memory *memory = &it->memory;
    int wide;
    *status = gt_find_place(it);
    if (*status != GT_OK || !memory->count || size <= GT_LEAST_APART * memory->shortest) return 0;
    wide = gt_far_apart(it, memory->count - 1, size);
    if (wide) *status = gt_move(it, t, x);
    return wide;
}

/* Keep the end of a step. An importer may have gone back. */
static gt_status gt_remember(gt_instance *it) {
    gt_memory *memory = &it->memory;
    gt_status status;
    if (!memory->begun) return GT_OK;
    while (memory->count && gt_time_kept(memory, memory->count - 1) > it->now.time + gt_one_time(memory, it->now.time)) memory->count--;
    if (memory->count && fabs(gt_time_kept(memory, memory->count - 1) - it->now.time) <= gt_one_time(memory, it->now.time)) return GT_OK;
    status = gt_find_place(it);
    return status == GT_OK ? gt_keep_place(it, 0, 0) : status;
}

static gt_status gt_check_delays(gt_instance *it) {
    gt_memory *memory = &it->memory;
    int d;
    gt_parameters(it);
    gt_delay_times(it->a, memory->delays, it->w);
    memory->shortest = INFINITY;
    memory->longest = 0;
    for (d = 0; d < GT_DELAYS; d++) {
        if (!(memory->delays[d] > 0) || !isfinite(memory->delays[d]))
            return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: the time of %s is %g s, expected one above zero", GT_NAME, gt_delay_names[d],
                          memory->delays[d]);
        memory->shortest = fmin(memory->shortest, memory->delays[d]);
        memory->longest = fmax(memory->longest, memory->delays[d]);
    }
    return GT_OK;
}

/* Before the first events: what is delayed was before what it is now. */
static gt_status gt_begin_past(gt_instance *it) {
    gt_memory *memory = &it->memory;
    gt_status status;
    if (memory->begun) return GT_OK;
    it->now.stale = 1;
    status = gt_refresh(it);
    memcpy(memory->first, it->now.u + GT_FIRST_DELAY, sizeof memory->first);
    memory->since = it->now.time;
    memory->begun = status == GT_OK;
    return status;
}

/* Samples are taken of what was before; then what is not smooth arrives. */
static void gt_arrive(gt_instance *it) {
    if (!it->memory.begun || gt_arriving(&it->memory, it->now.time) < 0) return;
    it->memory.since = it->now.time;
    it->now.stale = it->outputs_stale = 1;
}

/* After the events of an instant: where something is not smooth, a piece begins. */
static gt_status gt_begin_piece(gt_instance *it) {
    gt_memory *memory = &it->memory;
    const int again = memory->count && fabs(gt_time_kept(memory, memory->count - 1) - it->now.time) <= gt_one_time(memory, it->now.time);
    const int changed = !memory->count || memcmp(memory->u, it->now.u, GT_FIRST_DELAY * sizeof(double)) ||
                        memcmp(memory->x, it->now.x, GT_STATES * sizeof(double)) ||
                        memcmp(memory->p, it->now.p, GT_PARAMETERS * sizeof(double)) ||
                        memcmp(memory->m, it->now.m, GT_MODES * sizeof(double));
    int left = changed ? GT_SMOOTH_AFTER : gt_arriving(memory, it->now.time), d;
    gt_status status;
    if (left < 0) return GT_OK;
    memory->since = it->now.time;
    status = gt_find_place(it);
    if (status != GT_OK) return status;
    for (d = 0; d < GT_DELAYS && memory->count; d++) {
        const double before = memory->kept[gt_kept_at(memory, memory->count - 1)][d][0], now = it->place[d][0];
        if (fabs(now - before) > GT_JUMP_OF_PAST * fmax(memory->sizes[d], fabs(now))) left = GT_SMOOTH_AFTER;
    }
    return gt_keep_place(it, left, again);
}

#endif
