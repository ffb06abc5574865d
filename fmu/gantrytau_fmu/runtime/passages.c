/* Singular poses on the way: what the solution came over to behind one is no motion of the model.
 *
 * Each block of equations has a measure that is zero where it is singular: the determinant of an implicit one, the
 * square root in a closed form. All are watched at the ends of steps.
 */

#define GT_STRIDE (1. / 32)        /* of the way of a step that is looked at again */
#define GT_SHORTEST_STRIDE 1e-5    /* rounding moves solutions next to a singular pose by its root */
#define GT_CLOSE 1e-4              /* determinants that are so much smaller than at the ends of the way are zero */
#define GT_POINTED 0.1             /* relative: how exactly root and rate tell the instant of a passage, and how low it is there */
#define GT_TOO_CLOSE 3e-5          /* of its largest size: no motion is followed there */
#define GT_APART 1e-6              /* relative: solutions that differ more are not the same */

/* Linear blocks are those of speeds, accelerations and forces; what makes them singular does so to positions. */
static int gt_is_watched(int i) {
    return i >= GT_BLOCKS || !(gt_blocks[i].frictions || gt_blocks[i].linear);
}

static gt_status gt_side_fails(gt_instance *it, int i, const char *why) {
    if (i < GT_BLOCKS) return gt_block_fails(it, gt_blocks + i, 0, why);
    return gt_say(it, GT_ERROR, GT_LOG_ERROR,
                  "%s: the equations for %s %s at time = %.9g s; the pose may be singular or out of reach, or the states cannot "
                  "describe it: keep away from it, or export the model with other states", GT_NAME, gt_root_names[i - GT_BLOCKS], why,
                  it->now.time);
}

/* The measures of closed forms at the present point; those of implicit blocks were found with their solution. */
static void gt_watch(gt_instance *it) {
    if (GT_ROOTS) gt_roots(it->a, it->now.sides + GT_BLOCKS, it->w);
}

/* What is on the other side of a singular pose than where the last step ended, or -1. */
static int gt_other_side(const gt_instance *it) {
    int i;
    for (i = 0; i < GT_BLOCKS; i++)
        if (gt_is_watched(i) && it->now.kept_sides[i] * it->now.sides[i] < 0) return i;
    return -1;
}

/* Two ways to assemble a mechanism may cross in a singular pose: a measure that was about to change its sign, and
 * did not, may have come over to the other way. The one that would change after `gone`, or -1. */
static int gt_turns(const double *sides, const double *rates, double gone) {
    int i;
    for (i = 0; i < GT_SIDES; i++)
        if (gt_is_watched(i) && (sides[i] + rates[i] * gone) * sides[i] < 0) return i;
    return -1;
}

static int gt_turned(const gt_instance *it) {
    return gt_turns(it->now.kept_sides, it->now.side_rates, it->now.time - it->now.kept_time);
}

/* What is so close to singular that errors, which a root magnifies, would hide where the motion goes; or -1. */
static int gt_close(const gt_instance *it) {
    int i;
    for (i = 0; i < GT_SIDES; i++)
        if (gt_is_watched(i) && fabs(it->now.sides[i]) < GT_TOO_CLOSE * it->now.largest_sides[i]) return i;
    return -1;
}

/* The present point is where the last step ended. */
static void gt_keep_point(gt_instance *it) {
    int i;
    gt_watch(it);
    it->now.kept_time = it->now.time;
    memcpy(it->now.kept_sides, it->now.sides, sizeof it->now.sides);
    for (i = 0; i < GT_SIDES; i++) it->now.largest_sides[i] = fmax(it->now.largest_sides[i], fabs(it->now.sides[i]));
    if (it->cosimulation) return;
    memcpy(it->now.kept_x, it->now.x, sizeof it->now.x);
    memcpy(it->now.kept_u, it->now.u, sizeof it->now.u);
    memcpy(it->now.kept_z, it->now.z, sizeof it->now.z);
}

static void gt_keep_sides(gt_instance *it) {
    const double gone = it->now.time - it->now.kept_time;
    int i;
    gt_watch(it);
    for (i = 0; i < GT_SIDES && gone != 0; i++) it->now.side_rates[i] = (it->now.sides[i] - it->now.kept_sides[i]) / gone;
    gt_keep_point(it);
}

/* Whether a measure comes near to zero, or is not where its rate led. */
static int gt_surprises(const gt_instance *it) {
    const double gone = it->now.time - it->now.kept_time;
    int i;
    for (i = 0; i < GT_BLOCKS; i++) {
        const double kept = it->now.kept_sides[i], expected = kept + it->now.side_rates[i] * gone;
        if (!gt_is_watched(i)) continue;
        if (expected * kept < 0.1 * kept * kept || fabs(it->now.sides[i] - expected) > 0.5 * fabs(kept)) return 1;
    }
    return 0;
}

/* The block, outside frictions, of which another solution is present than z; or -1. */
static int gt_other_solution(const gt_instance *it, const double *z) {
    int i, j;
    for (i = 0; i < GT_BLOCKS; i++)
        for (j = gt_blocks[i].first; j < gt_blocks[i].first + gt_blocks[i].count; j++)
            if (gt_is_watched(i) && fabs(it->now.z[j] - z[j]) > GT_APART * (1 + fabs(z[j]))) return i;
    return -1;
}

/* Walk from where the last step ended to the present point, with steps that shorten where a determinant is about to
 * change its sign: the block that passes a singular pose on the way, or has another solution at its end, or -1. Where
 * the way, which is not quite that of the motion, leaves what can be reached, it says nothing. */
static int gt_crosses(gt_instance *it) {
    const double *const there[3] = {it->a[0], it->a[1], it->a[2]};
    double x[GT_ROOM(GT_STATES)], u[GT_ROOM(GT_KNOWN)], time, rates[GT_ROOM(GT_SIDES)];
    double z[GT_ROOM(GT_ALGEBRAICS)], sides[GT_ROOM(GT_SIDES)], z_there[GT_ROOM(GT_ALGEBRAICS)], sides_there[GT_ROOM(GT_SIDES)];
    double share = 0, size = GT_STRIDE, beyond = 0;
    int passed = -1, i;
    memcpy(z_there, it->now.z, sizeof z_there);
    memcpy(sides_there, it->now.sides, sizeof sides_there);
    memcpy(z, it->now.kept_z, sizeof z);
    memcpy(sides, it->now.kept_sides, sizeof sides);
    for (i = 0; i < GT_SIDES; i++) rates[i] = it->now.side_rates[i] * (it->now.time - it->now.kept_time);
    it->a[0] = &time;
    it->a[1] = x;
    it->a[2] = u;
    while (share < 1 && size > GT_SHORTEST_STRIDE) {
        const double next = fmin(share + size, 1);
        int solved, turns = -1;
        gt_between(1, next, &it->now.kept_time, there[0], &time);
        gt_between(GT_STATES, next, it->now.kept_x, there[1], x);
        gt_between(GT_KNOWN, next, it->now.kept_u, there[2], u);
        memcpy(it->now.z, z, sizeof z);
        solved = gt_solve_blocks(it, 1, 0) == GT_OK;
        gt_watch(it);
        if (solved) turns = gt_other_side(it);
        if (solved && turns < 0) turns = gt_turns(sides, rates, next - share);
        if (turns >= 0) {
            passed = turns;
            beyond = fmax(beyond, next);
            if (fabs(sides[turns]) < GT_CLOSE * fmax(fabs(it->now.kept_sides[turns]), fabs(sides_there[turns]))) break;
        }
        if (!solved || turns >= 0) {
            size /= 4;
            continue;
        }
        if (next >= beyond) passed = -1;
        for (i = 0; i < GT_SIDES; i++) rates[i] = (it->now.sides[i] - sides[i]) / (next - share);
        memcpy(z, it->now.z, sizeof z);
        memcpy(sides, it->now.sides, sizeof sides);
        size = fmin(GT_STRIDE, 2 * size);
        share = next;
    }
    if (share == 1) passed = gt_other_solution(it, z_there);
    memcpy(it->a, there, sizeof there);
    memcpy(it->now.z, z_there, sizeof z_there);
    memcpy(it->now.sides, sides_there, sizeof sides_there);
    it->factors_stale = 1;
    return passed;
}

/* Rates of states, and of the measures of closed forms along the motion, by a difference. */
static void gt_root_rates(gt_instance *it, double span, double *slopes, double *rates) {
    const double *const there[2] = {it->a[0], it->a[1]};
    const double delta = gt_small_time(it->now.time, span);
    double x[GT_ROOM(GT_STATES)], moved[GT_ROOM(GT_ROOTS)], time = it->now.time + delta;
    int i;
    gt_rates(it->a, slopes, it->w);
    for (i = 0; i < GT_STATES; i++) x[i] = it->now.x[i] + delta * slopes[i];
    it->a[0] = &time;
    it->a[1] = x;
    gt_roots(it->a, moved, it->w);
    memcpy(it->a, there, sizeof there);
    for (i = 0; i < GT_ROOTS; i++) rates[i] = (moved[i] - it->now.sides[GT_BLOCKS + i]) / delta;
}

/* The roots at a share of the step that ends at the present point, where cubics lead from one end to the other. */
static void gt_roots_between(gt_instance *it, double share, double span, const double *slopes, double *found) {
    const double *const there[2] = {it->a[0], it->a[1]};
    const double s = share, r = 1 - s;
    double x[GT_ROOM(GT_STATES)], time = it->now.kept_time + share * span;
    int i;
    for (i = 0; i < GT_STATES; i++)
        x[i] = r * r * (1 + 2 * s) * it->now.kept_x[i] + s * s * (1 + 2 * r) * it->now.x[i] +
               span * s * r * (r * it->now.kept_rates[i] - s * slopes[i]);
    it->a[0] = &time;
    it->a[1] = x;
    gt_roots(it->a, found, it->w);
    memcpy(it->a, there, sizeof there);
}

/* A root that came down to zero and up again, as if mirrored there, on the step that ends at the present point; or -1.
 * At both ends root and rate point to the same instant, and there it is low, or there is none. */
static int gt_mirrored(gt_instance *it) {
    const double span = it->now.time - it->now.kept_time;
    double slopes[GT_ROOM(GT_STATES)], rates[GT_ROOM(GT_ROOTS)], between[GT_ROOM(GT_ROOTS)];
    int i, found = -1;
    if (!(span > 0)) return -1;
    gt_watch(it);
    gt_root_rates(it, span, slopes, rates);
    for (i = 0; i < GT_ROOTS; i++) {
        const double before = it->now.kept_sides[GT_BLOCKS + i], after = it->now.sides[GT_BLOCKS + i];
        const double down = it->now.root_rates[i], up = rates[i];
        if (!(down < 0 && up > 0 && fabs(before / -down + after / up - span) < GT_POINTED * span)) continue;
        gt_roots_between(it, before / -down / span, span, slopes, between);
        if (!(between[i] > GT_POINTED * fmax(before, after))) found = GT_BLOCKS + i;
    }
    memcpy(it->now.root_rates, rates, sizeof rates);
    memcpy(it->now.kept_rates, slopes, sizeof slopes);
    return found;
}

static gt_status gt_completed(gt_instance *it) {
    const gt_status status = gt_refresh(it);
    int passed = -1;
    if (status != GT_OK) return status;
    if (GT_BLOCKS) passed = gt_other_side(it);
    /* the integrators of Co-Simulation watch it themselves, and try shorter steps */
    if (GT_BLOCKS && passed < 0 && !it->cosimulation && gt_surprises(it)) passed = gt_crosses(it);
    if (GT_ROOTS && passed < 0 && !it->cosimulation) passed = gt_mirrored(it);
    if (passed >= 0) return gt_side_fails(it, passed, "have passed a singular pose");
    gt_keep_sides(it);
    if (GT_SIDES && (passed = gt_close(it)) >= 0) return gt_side_fails(it, passed, "become singular");
    return GT_OK;
}
