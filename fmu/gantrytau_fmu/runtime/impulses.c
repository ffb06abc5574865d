/* Impulses: what jumps where a mode turns that stands below the highest derivatives, level by level: J Y = b, as in
 * simulation/events/impulses.py. States keep what they are told at the start.
 */

#define GT_NOTHING 1e-12     /* of the terms of a constraint: less is no jump */
#define GT_NO_IMPULSE 1e-9   /* of its terms */
#define GT_STRAIGHT 1e-11    /* of the largest jump: J does not change along it */
#define GT_PARTS 64          /* of a jump along which it does */

#if GT_LEVELS
/* Before modes turn at the present point, whose margins these are, NULL as long as it has none. */
static void gt_before(gt_instance *it, const gt_margins *margins) {
    int i;
    memcpy(it->x_before, it->now.x, sizeof it->x_before);
    memcpy(it->m_before, it->now.m, sizeof it->m_before);
    it->jumping = margins && !it->resting;
    if (!it->jumping) return;
    gt_symbols(it->a, it->symbols_before, it->w);
    it->late = GT_LATE + GT_LATE_BY_TIME * fabs(it->now.time);
    for (i = 0; i < GT_TURNS; i++) { /* an importer may stop far behind a turn */
        const double gap = (gt_turn_counts[i] ? margins->values[i] - nearbyint(margins->values[i]) : margins->values[i]);
        const double behind = -gap / (gt_turn_counts[i] ? -margins->rates[i] : margins->rates[i]);
        const int turned = gt_turn_counts[i] ? floor(margins->values[i]) != it->now.m[GT_FRICTIONS + i]
                                             : (margins->values[i] > 0) != (it->now.m[GT_FRICTIONS + i] > 0);
        if (turned && margins->rates[i] != 0 && isfinite(behind)) it->late = fmax(it->late, 2 * fabs(behind));
    }
}

/* J Y = b at the present symbols; whether there is a Y. */
static int gt_jump_of(gt_instance *it, const double *b, double *jump) {
    double scales[GT_UNKNOWNS];
    int pivots[GT_UNKNOWNS];
    gt_impulses(it->a, it->impulses, it->w);
    if (!gt_factor(GT_UNKNOWNS, it->impulses, pivots, scales)) return 0;
    memcpy(jump, b, GT_UNKNOWNS * sizeof(double));
    gt_solve_factored(GT_UNKNOWNS, it->impulses, pivots, scales, jump);
    return 1;
}

static void gt_go(gt_instance *it, int k, const double *from, double share, const double *jump) {
    int j;
    for (j = 0; j < GT_UNKNOWNS; j++)
        if (gt_unknown_orders[j] >= k) it->symbols[gt_unknown_ends[j] - k] = from[gt_unknown_ends[j] - k] + share * jump[j];
}

static double gt_largest(const double *values) {
    double largest = 0;
    int j;
    for (j = 0; j < GT_UNKNOWNS; j++) largest = fmax(largest, fabs(values[j]));
    return largest;
}

/* Along the whole jump: in one step where J stays, else by Runge and Kutta. */
static int gt_lead(gt_instance *it, int k, const double *b, double *jump) {
    double from[GT_SYMBOLS], other[GT_UNKNOWNS], mean[GT_UNKNOWNS];
    static const double shares[] = {0.5, 0.5, 1}, weights[] = {2, 2, 1};
    int straight = 1, part, stage, j;
    memcpy(from, it->symbols, sizeof from);
    if (!gt_jump_of(it, b, jump)) return 0;
    for (stage = 0; stage < 2 && straight; stage++) {
        gt_go(it, k, from, stage ? 1 : 0.37, jump);
        if (!gt_jump_of(it, b, other)) return 0;
        for (j = 0; j < GT_UNKNOWNS; j++) other[j] -= jump[j];
        straight = gt_largest(other) <= GT_STRAIGHT * gt_largest(jump);
    }
    if (straight) return 1;
    memcpy(it->symbols, from, sizeof from);
    memset(jump, 0, GT_UNKNOWNS * sizeof(double));
    for (part = 0; part < GT_PARTS; part++) {
        memcpy(from, it->symbols, sizeof from);
        if (!gt_jump_of(it, b, other)) return 0;
        memcpy(mean, other, sizeof mean);
        for (stage = 0; stage < 3; stage++) {
            gt_go(it, k, from, shares[stage] / GT_PARTS, other);
            if (!gt_jump_of(it, b, other)) return 0;
            for (j = 0; j < GT_UNKNOWNS; j++) mean[j] += weights[stage] * other[j];
        }
        gt_go(it, k, from, 1. / 6 / GT_PARTS, mean);
        for (j = 0; j < GT_UNKNOWNS; j++) jump[j] += mean[j] / 6 / GT_PARTS;
    }
    return 1;
}

static gt_status gt_refuse_jump(gt_instance *it, const char *name, const char *why) {
    int i;
    for (i = 0; i < GT_TURNS - 1 && it->now.m[GT_FRICTIONS + i] == it->m_before[GT_FRICTIONS + i]; i++) {}
    return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: at time = %.9g s %s turns, and %s %s", GT_NAME, it->now.time, gt_conditions[i], name, why);
}

/* J Y at the present symbols, and the sizes of its terms. */
static void gt_times(gt_instance *it, const double *jump, double *product, double *size) {
    int i, j;
    gt_impulses(it->a, it->impulses, it->w);
    for (i = 0; i < GT_UNKNOWNS; i++)
        for (product[i] = size[i] = 0, j = 0; j < GT_UNKNOWNS; j++) {
            product[i] += it->impulses[i + j * GT_UNKNOWNS] * jump[j];
            size[i] += fabs(it->impulses[i + j * GT_UNKNOWNS] * jump[j]);
        }
}

/* Refuses what would be more than an impulse, and impulses in laws that are not linear in them. */
static gt_status gt_check_jump(gt_instance *it, int k, const double *b, const double *jump) {
    double one[GT_UNKNOWNS], part[GT_UNKNOWNS], terms[GT_UNKNOWNS], product[GT_UNKNOWNS], size[GT_UNKNOWNS], from[GT_SYMBOLS];
    int i, j;
    memset(terms, 0, sizeof terms);
    for (i = 0; i < GT_UNKNOWNS; i++) {
        if (b[i] == 0) continue;
        memset(one, 0, sizeof one);
        one[i] = b[i];
        if (!gt_jump_of(it, one, part)) return GT_ERROR;
        for (j = 0; j < GT_UNKNOWNS; j++) terms[j] += fabs(part[j]);
    }
    gt_times(it, jump, product, size);
    memcpy(from, it->symbols, sizeof from);
    for (j = 0; j < GT_UNKNOWNS; j++) {
        if (fabs(jump[j]) <= GT_NO_IMPULSE * terms[j]) continue;
        if (k >= gt_unknown_orders[j] + 2)
            return gt_refuse_jump(it, gt_unknown_names[j], "would be infinite, more than an impulse: a position jumps on a mass, or the "
                                  "like; let it rise within a time, or put a spring or damper between");
        it->symbols[gt_unknown_ends[j]] += jump[j];
    }
    gt_times(it, jump, one, part);
    memcpy(it->symbols, from, sizeof from);
    for (i = 0; i < GT_UNKNOWNS; i++)
        if (gt_equation_counts[i] == 0 && fabs(one[i] - product[i]) > GT_NO_IMPULSE * size[i])
            return gt_refuse_jump(it, "the jump", "takes impulses that stand in a law that is not linear in them: smooth what turns, or "
                                  "make the law linear");
    return GT_OK;
}

/* The states behind the turn to the present modes, from those before it. */
static gt_status gt_throw(gt_instance *it) {
    double old[4 * GT_UNKNOWNS], here[4 * GT_UNKNOWNS], b[GT_UNKNOWNS], jump[GT_UNKNOWNS], now[GT_SYMBOLS], modes[GT_ROOM(GT_MODES)];
    gt_status status = GT_OK;
    int i, k, any;
    if (!it->jumping) return GT_OK;
    memcpy(it->now.x, it->x_before, sizeof it->now.x);
    memcpy(now, it->symbols_before, sizeof now);
    memcpy(modes, it->now.m, sizeof modes);
    memset(it->jumps, 0, sizeof it->jumps);
    for (k = GT_LEVELS; k > 0 && status == GT_OK; k--) {
        memcpy(it->symbols, it->symbols_before, sizeof it->symbols);
        memcpy(it->now.m, it->m_before, sizeof modes);
        gt_levels[k - 1](it->a, old, it->w);
        memcpy(it->symbols, now, sizeof now);
        memcpy(it->now.m, modes, sizeof modes);
        gt_levels[k - 1](it->a, here, it->w);
        for (any = 0, i = 0; i < GT_UNKNOWNS; i++) { /* residuals, sizes of terms and rates, and the balance with other levels */
            const double *terms = here + GT_UNKNOWNS, *rates = here + 2 * GT_UNKNOWNS, lack = here[i] - old[i];
            const double noise = GT_NOTHING * (terms[i] + old[GT_UNKNOWNS + i]) + it->late * (rates[i] + old[2 * GT_UNKNOWNS + i]);
            b[i] = here[3 * GT_UNKNOWNS + i] - (fabs(lack) > noise ? lack : 0);
            any |= b[i] != 0;
        }
        if (!any) continue;
        if (!gt_lead(it, k, b, jump))
            return gt_refuse_jump(it, "what jumps", "is not determined by the equations behind it: expected a mass or an inertia for "
                                  "every motion on both sides");
        status = gt_check_jump(it, k, b, jump);
        memcpy(it->jumps + (k - 1) * GT_UNKNOWNS, jump, sizeof jump);
        memcpy(now, it->symbols, sizeof now);
    }
    for (i = 0; i < GT_STATES && status == GT_OK; i++)
        it->now.x[i] += now[gt_state_symbols[i]] - it->symbols_before[gt_state_symbols[i]];
    return status;
}

static void gt_take_back(gt_instance *it) {
    memcpy(it->now.x, it->x_before, sizeof it->now.x);
}
#endif
