/* What delays look back at: values, rates and second rates where steps ended, joined by polynomials of order 5.
 *
 * A place stands twice where something is not smooth; a delay later a step ends there, again and again until it is smooth.
 */
#if GT_DELAYS

#define GT_SAME_PAST 1e-11 /* of the shortest delay: two times are one */
#define GT_SMOOTH_AFTER 6  /* delays behind a jump the solution has so many derivatives more */

static int gt_kept_at(const gt_memory *memory, int k) {
    return (memory->oldest + k) % GT_MEMORY;
}

static double gt_time_kept(const gt_memory *memory, int k) {
    return memory->t[gt_kept_at(memory, k)];
}

/* Below that, two times near `time` are one. */
static double gt_one_time(const gt_memory *memory, double time) {
    return fmax(GT_SAME_PAST * memory->shortest, 9e-16 * fabs(time));
}

/* The last place that is no later than `time`, or -1. */
static int gt_last_before(const gt_memory *memory, double time) {
    int low = -1, high = memory->count;
    while (high - low > 1) {
        const int middle = low + (high - low) / 2;
        if (gt_time_kept(memory, middle) <= time) low = middle;
        else high = middle;
    }
    return low;
}

/* Value, rate and second rate at a share s of the interval of length h between two places. */
static void gt_between_places(const double *begin, const double *end, int straight, double h, double s, double *found) {
    const double p = begin[0], v = begin[1] * h, a = begin[2] * h * h, w = end[1] * h, b = end[2] * h * h;
    const double e0 = end[0] - p - v - a / 2, e1 = w - v - a, e2 = b - a;
    const double c3 = 10 * e0 - 4 * e1 + e2 / 2, c4 = -15 * e0 + 7 * e1 - e2, c5 = 6 * e0 - 3 * e1 + e2 / 2;
    if (straight) {
        found[0] = p + s * (end[0] - p);
        found[1] = (end[0] - p) / h;
        found[2] = 0;
        return;
    }
    found[0] = p + s * (v + s * (a / 2 + s * (c3 + s * (c4 + s * c5))));
    found[1] = (v + s * (a + s * (3 * c3 + s * (4 * c4 + s * 5 * c5)))) / h;
    found[2] = (a + s * (6 * c3 + s * (12 * c4 + s * 20 * c5))) / (h * h);
}

/* Value, rate and second rate of one delay at `time`: where the past jumps, behind that at the begin of the present
 * piece, else before it. */
static void gt_recall_one(const gt_memory *memory, int delay, double time, double *found) {
    const double same = gt_one_time(memory, time), s = time - memory->delays[delay];
    const int k = gt_last_before(memory, time <= memory->since + same ? s + same : s - same);
    const int first = k > 0 && k == memory->count - 1 && gt_time_kept(memory, k) > gt_time_kept(memory, k - 1) ? k - 1 : k;
    const int here = gt_kept_at(memory, first < 0 ? 0 : first), next = gt_kept_at(memory, first + 1);
    const double *begin = memory->kept[here][delay], gone = s - memory->t[here];
    found[0] = memory->first[delay];
    found[1] = found[2] = 0;
    if (k < 0) return;
    if (first < memory->count - 1) {
        const double h = memory->t[next] - memory->t[here];
        gt_between_places(begin, memory->kept[next][delay], memory->straight[next], h, gone / h, found);
        return;
    }
    found[0] = begin[0] + gone * (begin[1] + 0.5 * gone * begin[2]);
    found[1] = begin[1] + gone * begin[2];
    found[2] = begin[2];
}

/* The delayed values at `time`, into an array of what is known. */
static void gt_put_past(const gt_instance *it, double time, double *u) {
    double found[3];
    int d;
    for (d = 0; d < GT_DELAYS && it->memory.begun; d++) {
        gt_recall_one(&it->memory, d, time, found);
        u[GT_FIRST_DELAY + d] = found[0];
    }
}

/* The rates of the delayed values at the present point, into the direction. */
static void gt_put_past_rates(gt_instance *it) {
    double found[3];
    int d;
    for (d = 0; d < GT_DELAYS && it->memory.begun; d++) {
        gt_recall_one(&it->memory, d, it->now.time, found);
        it->du[GT_FIRST_DELAY + d] = found[1];
    }
}

/* How often what arrives at the present time goes on to travel; -1 if nothing arrives. */
static int gt_arriving(const gt_memory *memory, double time) {
    const double same = gt_one_time(memory, time);
    int found = -1, d, k;
    for (d = 0; d < GT_DELAYS; d++)
        for (k = gt_last_before(memory, time - memory->delays[d] + same); k >= 0; k--) {
            const int left = memory->left[gt_kept_at(memory, k)];
            if (gt_time_kept(memory, k) + memory->delays[d] < time - same) break;
            if (left - 1 > found) found = left - 1;
        }
    return found;
}

/* The next time at which something that is not smooth arrives; INFINITY if there is none. */
static double gt_next_arrival(const gt_memory *memory, double time) {
    const double same = gt_one_time(memory, time);
    double next = INFINITY;
    int d, k;
    for (d = 0; d < GT_DELAYS; d++)
        for (k = gt_last_before(memory, time - memory->delays[d] + same) + 1; k < memory->count; k++)
            if (memory->left[gt_kept_at(memory, k)] > 0) {
                next = fmin(next, gt_time_kept(memory, k) + memory->delays[d]);
                break;
            }
    return next;
}

/* Before the start, delayed values are what they look back at: they are made so at the point that it->a shows. */
static gt_status gt_settle_past(gt_instance *it) {
    double found[GT_DELAYS], matrix[GT_DELAYS * GT_DELAYS], scales[GT_DELAYS], *u = it->now.u + GT_FIRST_DELAY;
    int pivots[GT_DELAYS], round, i, j;
    for (round = 0; round < 50; round++) {
        double size = 0;
        gt_past(it->a, found, it->w);
        for (i = 0; i < GT_DELAYS; i++) {
            found[i] -= u[i];
            size = fmax(size, isfinite(found[i]) ? fabs(found[i]) / (1 + fabs(u[i])) : INFINITY);
        }
        if (size <= 1e-13) return GT_OK;
        if (!(size < INFINITY) || (GT_BLOCKS && gt_factors(it) != GT_OK)) break;
        for (j = 0; j < GT_DELAYS; j++) {
            gt_clear_direction(it);
            it->du[GT_FIRST_DELAY + j] = 1;
            if (GT_BLOCKS) gt_along_states(it, 0);
            gt_past_rates(it->a, matrix + j * GT_DELAYS, it->w);
            for (i = 0; i < GT_DELAYS; i++) matrix[i + j * GT_DELAYS] = (i == j) - matrix[i + j * GT_DELAYS];
        }
        if (!gt_factor(GT_DELAYS, matrix, pivots, scales)) break;
        gt_solve_factored(GT_DELAYS, matrix, pivots, scales, found);
        for (i = 0; i < GT_DELAYS; i++) u[i] += found[i];
        it->factors_stale = 1;
        if (gt_solve(it, 0) != GT_OK) return GT_ERROR;
        if (size <= 1e-11) return GT_OK; /* the next step would be rounding */
    }
    return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: what %s is before the start is not determined at time = %.9g s, for it looks back at itself; "
                  "check start values, inputs and parameters", GT_NAME, gt_delay_names[0], it->now.time);
}

#endif
