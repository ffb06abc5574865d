/* What switches: modes, which hold between two events, and margins, whose zeros turn them.
 *
 * A mode is 1 where its margin is above zero, else 0; one that counts is the whole number below its margin. In between
 * two events the equations are those of the modes, as smooth as between two switches; an event is where a margin has
 * passed the next turn by more than rounding.
 */

#define GT_SAME_TIMES 8     /* spacings of the time, within which margins of time alone are zero */
#define GT_NEAR 16          /* times rounding, and times in s, and shares of the time: what a crossing is located to */
#define GT_LATE 2e-13
#define GT_LATE_BY_TIME 4e-14
#define GT_MOST_AGREED 24   /* rounds in which modes lead to each other */
#define GT_MOST_CHOICES 1024 /* of modes that are tried where they do not lead to each other */
#define GT_DEEP 0.5         /* of the lower end: a dip between two places that may reach below that is looked at */
#define GT_STRAYS 0.1       /* of the larger end: so far from the cubic through the ends a middle is unknown */
#define GT_FORESIGHT 4      /* steps within which a margin that falls to zero may be why one fails */
#define GT_LEFT 10          /* times the tolerance: what may be left of a margin that is not reached */
#define GT_ROUNDING 1.8e-15 /* the noise of a margin in units of its terms: ROUNDING of simulation/events/margins.py */

/* Behind the rates of the margins stands that of the fastest angle in them, in rad/s. */
typedef struct { double values[GT_ROOM(GT_TURNS)], rates[GT_TURNS + 1], noise[GT_ROOM(GT_TURNS)]; } gt_margins;

/* impulses.c: what jumps with modes, from the point before they turn */
#if GT_LEVELS
static void gt_before(gt_instance *it, const gt_margins *margins);
static gt_status gt_throw(gt_instance *it);
static void gt_take_back(gt_instance *it);
#else
#define gt_before(it, margins) ((void)(margins))
#define gt_throw(it) GT_OK
#define gt_take_back(it) ((void)(it))
#endif

/* How far each switch is from its next turn: below zero its mode does not hold. Two of one that counts. pace: of the fastest
 * angle, rad/s. */
typedef struct { double left[GT_ROOM(GT_GAPS)], rates[GT_ROOM(GT_GAPS)], noise[GT_ROOM(GT_GAPS)], pace; } gt_gaps;

/* The direction of the motion at the present point into dt, dx, dz; dz stays zero where it is not determined. */
static void gt_along_motion(gt_instance *it, const double *rates) {
    int number, sound = 1;
    gt_clear_direction(it);
    memset(it->dz, 0, sizeof it->dz);
    it->dt = 1;
    memcpy(it->dx, rates, GT_STATES * sizeof(double));
#if GT_DELAYS
    gt_put_past_rates(it);
#endif
    if (!GT_TURNS_OF_BLOCKS) return;
    for (number = 0; number < GT_BLOCKS && it->factors_stale && sound; number++)
        sound = gt_factor_block(it, gt_blocks + number) != 0;
    if (!sound) return;
    it->factors_stale = 0;
    gt_along_states(it, 0);
}

/* At the present point. Rates are those along the motion, in 1/s. */
static gt_status gt_look(gt_instance *it, gt_margins *found) {
    double both[GT_ROOM(2 * GT_TURNS)], rates[GT_ROOM(GT_STATES)], spacing;
    gt_status status = gt_refresh(it);
    int i;
    found->rates[GT_TURNS] = 0;
    if (status != GT_OK || !GT_TURNS) return status;
    gt_rates(it->a, rates, it->w);
    gt_along_motion(it, rates);
    gt_turning(it->a, both, it->w);
    gt_turning_rates(it->a, found->rates, it->w);
    spacing = GT_SAME_TIMES * (nextafter(fabs(it->now.time), INFINITY) - fabs(it->now.time));
    for (i = 0; i < GT_TURNS; i++) {
        found->values[i] = both[i];
        if (!isfinite(found->rates[i])) found->rates[i] = 0; /* what only the other side may ask */
        found->noise[i] = both[GT_TURNS + i] + spacing * fabs(found->rates[i]);
        if (!isfinite(both[i]))
            return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: %s has no finite margin at time = %.9g s; the model has no solution there: keep "
                          "away from it", GT_NAME, gt_conditions[i], it->now.time);
    }
    return GT_OK;
}

static void gt_find_gaps(const gt_instance *it, const gt_margins *margins, gt_gaps *found) {
    const double *modes = it->now.m + GT_FRICTIONS;
    int i, more = GT_TURNS;
    found->pace = isfinite(margins->rates[GT_TURNS]) ? margins->rates[GT_TURNS] : 0;
    for (i = 0; i < GT_TURNS; i++) {
        const double sign = gt_turn_counts[i] ? 1 : 2 * modes[i] - 1;
        found->left[i] = sign * margins->values[i] - (gt_turn_counts[i] ? modes[i] : 0);
        found->rates[i] = sign * margins->rates[i];
        found->noise[i] = margins->noise[i] + it->now.slack[i];
        if (!gt_turn_counts[i]) continue;
        found->left[more] = modes[i] + 1 - margins->values[i];
        found->rates[more] = -margins->rates[i];
        found->noise[more] = margins->noise[i] + it->now.slack[more];
        more++;
    }
}

static gt_status gt_look_at_gaps(gt_instance *it, gt_gaps *found) {
    gt_margins margins;
    const gt_status status = gt_look(it, &margins);
    if (status == GT_OK) gt_find_gaps(it, &margins, found);
    return status;
}

/* The modes just after the present instant: where a margin is zero, its rate decides, or, for samples, it has not turned. */
static void gt_following(const gt_instance *it, const gt_margins *at, double *modes) {
    int i, more = GT_TURNS;
    for (i = 0; i < GT_TURNS; i++) {
        const double slack = fmax(it->now.slack[i], gt_turn_counts[i] ? it->now.slack[more++] : 0);
        const double value = at->values[i], whole = gt_turn_counts[i] ? nearbyint(value) : 0;
        const double kept = it->now.m[GT_FRICTIONS + i];
        /* as near as a crossing is located, so that what turns round there is not left behind it */
        const double late = GT_LATE + GT_LATE_BY_TIME * fabs(it->now.time);
        const double near = GT_NEAR * at->noise[i] + late * fabs(at->rates[i]) + 1.5 * slack;
        if (it->sampling && fabs(value - whole) <= near && (!gt_turn_counts[i] || kept == whole || kept == whole - 1))
            modes[i] = kept;
        else if (fabs(value - whole) <= near && at->rates[i] != 0)
            modes[i] = gt_turn_counts[i] ? whole - (at->rates[i] < 0) : at->rates[i] > 0;
        else
            modes[i] = gt_turn_counts[i] ? floor(value) : gt_turn_closed[i] ? value >= 0 : value > 0;
    }
}

/* The modes that the margins of the present point lead to when it has these. */
static gt_status gt_led_to(gt_instance *it, const double *modes, double *found) {
    gt_margins margins;
    gt_status status;
    memcpy(it->now.m + GT_FRICTIONS, modes, GT_TURNS * sizeof(double));
    status = gt_throw(it);
    it->now.stale = it->outputs_stale = 1;
    if (status == GT_OK) status = gt_look(it, &margins);
    if (status == GT_OK) gt_following(it, &margins, found);
    return status;
}

static int gt_are_equal(const double *some, const double *others) {
    return !memcmp(some, others, GT_TURNS * sizeof(double));
}

/* Modes that agree with themselves, of all between those that were tried, the nearest to the first; all: both sides of every
 * switch besides. 0 if there are none, or too many to be tried. */
static int gt_search(gt_instance *it, double (*tried)[GT_ROOM(GT_TURNS)], int count, int all) {
    double low[GT_ROOM(GT_TURNS)], high[GT_ROOM(GT_TURNS)], modes[GT_ROOM(GT_TURNS)], best[GT_ROOM(GT_TURNS)];
    double found[GT_ROOM(GT_TURNS)], choices = 1, nearest = INFINITY;
    const gt_sink kept = it->sink;
    int i, k;
    for (i = 0; i < GT_TURNS; i++) {
        low[i] = high[i] = tried[0][i];
        for (k = 1; k < count; k++) {
            low[i] = fmin(low[i], tried[k][i]);
            high[i] = fmax(high[i], tried[k][i]);
        }
        if (all && !gt_turn_counts[i]) {
            low[i] = 0;
            high[i] = 1;
        }
        choices *= high[i] - low[i] + 1;
    }
    if (!(choices <= GT_MOST_CHOICES)) return 0;
    memcpy(modes, low, sizeof modes);
    it->sink = NULL; /* a choice that has no solution is no failure */
    do {
        double apart = 0;
        for (k = 0; k < GT_TURNS; k++) apart += fabs(modes[k] - tried[0][k]);
        if (apart < nearest && gt_led_to(it, modes, found) == GT_OK && gt_are_equal(modes, found)) {
            memcpy(best, modes, sizeof best);
            nearest = apart;
        }
        for (i = 0; i < GT_TURNS && ++modes[i] > high[i]; i++) modes[i] = low[i];
    } while (i < GT_TURNS);
    if (nearest < INFINITY && gt_led_to(it, best, found) != GT_OK) nearest = INFINITY;
    it->sink = kept;
    return nearest < INFINITY;
}

/* No modes agree with the margins that they lead to: says why, back at the first that were tried. */
static gt_status gt_disagree(gt_instance *it, double (*tried)[GT_ROOM(GT_TURNS)], int count, gt_status status) {
    double found[GT_ROOM(GT_TURNS)];
    int i;
    if (status != GT_OK) status = gt_led_to(it, tried[count - 1], found);
    memcpy(it->now.m + GT_FRICTIONS, tried[0], GT_TURNS * sizeof(double));
    gt_take_back(it);
    it->now.stale = 1;
    if (status != GT_OK) return status;
    for (i = 0; i < GT_TURNS - 1 && tried[0][i] == tried[count - 1][i]; i++) {}
    return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: at time = %.9g s no side of %s agrees with what follows from it: the equations have no "
                  "solution there, or the motion would slide along the switch; smooth it, as tanh(x / small) for sign(x), or "
                  "change what jumps", GT_NAME, it->now.time, gt_conditions[i]);
}

/* Modes that agree with the margins they lead to, from the present ones on; *changed tells whether they are others. */
static gt_status gt_agree(gt_instance *it, int *changed) {
    double tried[GT_MOST_AGREED][GT_ROOM(GT_TURNS)], found[GT_ROOM(GT_TURNS)];
    double *modes = it->now.m + GT_FRICTIONS;
    const gt_sink kept = it->sink;
    int count = 0, i, k;
    *changed = 0;
    if (!GT_TURNS) return GT_OK;
    memcpy(found, modes, GT_TURNS * sizeof(double));
    gt_before(it, NULL);
    for (;;) {
        gt_status status;
        memcpy(tried[count], found, sizeof found);
        it->sink = NULL; /* where these lead to nothing, others may hold */
        if (count) status = gt_led_to(it, tried[count], found);
        else {
            gt_margins margins;
            status = gt_look(it, &margins);
            if (status == GT_OK) gt_before(it, &margins);
            if (status == GT_OK) gt_following(it, &margins, found);
        }
        it->sink = kept;
        if (status == GT_OK && gt_are_equal(found, tried[count])) break;
        count++;
        for (k = 0; k < count && !gt_are_equal(found, tried[k]); k++) {}
        if (status == GT_OK && k == count && count < GT_MOST_AGREED) continue;
        if (gt_search(it, tried, count, 0) || gt_search(it, tried, count, 1)) break;
        return gt_disagree(it, tried, count, status);
    }
    for (i = 0; i < GT_TURNS; i++)
        if (modes[i] != tried[0][i]) {
            *changed = 1;
            it->last_event = gt_conditions[i];
            gt_say(it, GT_OK, GT_LOG_EVENTS, "%s: at time = %.9g s %s turns", GT_NAME, it->now.time, gt_conditions[i]);
        }
    return GT_OK;
}

/* After an event: what is behind a turn but goes back (a ball that has just been thrown up) is not looked at until it has
 * passed by as much again, or an importer that looks at signs would take it for passed already. */
static gt_status gt_slacken(gt_instance *it) {
    gt_gaps gaps;
    gt_status status;
    int i;
    memset(it->now.slack, 0, sizeof it->now.slack);
    if (!GT_TURNS) return GT_OK;
    status = gt_look_at_gaps(it, &gaps);
    for (i = 0; i < GT_GAPS && status == GT_OK; i++) it->now.slack[i] = fmax(0, -gaps.left[i]);
    return status;
}

/* What has come out before its turn again needs no slack. */
static void gt_tighten(gt_instance *it, const gt_gaps *gaps) {
    int i;
    for (i = 0; i < GT_GAPS; i++)
        if (gaps->left[i] > 0) it->now.slack[i] = 0;
}

/* Whether something is farther behind its turn than it was located. */
static int gt_lies_behind(const gt_instance *it, const gt_gaps *gaps) {
    int i;
    for (i = 0; i < GT_GAPS; i++)
        if (gaps->left[i] < -GT_NEAR * gaps->noise[i] - 1.5 * it->now.slack[i]) return 1;
    return 0;
}

/* The next instant at which something turns by the time alone; INFINITY if there is none. */
static gt_status gt_next_turn(gt_instance *it, double *next) {
    gt_margins margins;
    gt_gaps gaps;
    gt_status status;
    int i, counted = GT_TURNS;
    *next = INFINITY;
    for (i = 0; i < GT_TURNS && !gt_turn_timed[i]; i++) {}
    if (i == GT_TURNS) return GT_OK;
    status = gt_look(it, &margins);
    if (status != GT_OK) return status;
    gt_find_gaps(it, &margins, &gaps);
    for (i = 0; i < GT_TURNS; i++) {
        const int second = gt_turn_counts[i] ? counted++ : i;
        if (!gt_turn_timed[i]) continue;
        if (gaps.rates[i] < 0 && gaps.left[i] > gaps.noise[i]) *next = fmin(*next, it->now.time - gaps.left[i] / gaps.rates[i]);
        if (gaps.rates[second] < 0 && gaps.left[second] > gaps.noise[second])
            *next = fmin(*next, it->now.time - gaps.left[second] / gaps.rates[second]);
    }
    return GT_OK;
}

/* ---- Along a step */

/* The share of a step of that size at which a gap is lowest between its ends, if it may come down to zero there; else 1. */
static double gt_dip(double size, const gt_gaps *first, const gt_gaps *last) {
    double share = 1;
    int i;
    for (i = 0; i < GT_GAPS; i++) {
        const double g0 = first->left[i], g1 = last->left[i], b = size * first->rates[i], e = size * last->rates[i];
        const double c = 3 * (g1 - g0) - 2 * b - e, d = 2 * (g0 - g1) + b + e;
        const double s = -b / (c + sqrt(fmax(c * c - 3 * b * d, 0)));
        if (!(b < 0 && e > 0 && fmin(g0, g1) > 4 * last->noise[i])) continue;
        if (g0 + s * (b + s * (c + s * d)) < GT_DEEP * fmin(g0, g1) && s < share) share = s;
    }
    return share;
}

/* Whether gaps in the middle of a step are not where the cubic through its ends has them: it is too long to know. The
 * states there are those of the cubics through theirs. */
static int gt_strays(gt_instance *it, double t, double size, const double *x, const double *rates, const gt_gaps *first,
                     const gt_gaps *last) {
    const gt_state kept = it->now;
    const gt_sink sink = it->sink;
    double slopes[GT_ROOM(GT_STATES)];
    gt_gaps middle;
    int i, strays = 0;
    gt_rates(it->a, slopes, it->w);
    for (i = 0; i < GT_STATES; i++) it->now.x[i] = 0.5 * (x[i] + kept.x[i]) + 0.125 * size * (rates[i] - slopes[i]);
    it->now.time = t + 0.5 * size;
    it->now.stale = 1;
    it->sink = NULL;
    if (gt_look_at_gaps(it, &middle) == GT_OK)
        for (i = 0; i < GT_GAPS; i++) {
            const double g0 = first->left[i], g1 = last->left[i], g = middle.left[i];
            const double expected = 0.5 * (g0 + g1) + 0.125 * size * (first->rates[i] - last->rates[i]);
            const double largest = fmax(fabs(g0), fabs(g1));
            if (g < -middle.noise[i] && g1 >= -last->noise[i]) strays = 1;
            if (fabs(g - expected) > GT_STRAYS * largest + 4 * middle.noise[i]) strays = 1;
        }
    it->sink = sink;
    it->now = kept;
    it->outputs_stale = it->factors_stale = 1;
    gt_point_at(it, &it->now.time, it->now.x);
    return strays;
}

/* Where a step of that size has failed: whether a margin that falls to zero may be why, with no more left of it than the
 * tolerance; then the states are put just behind it by the shortest way. */
static int gt_put_behind(gt_instance *it, double size) {
    double slopes[GT_TURNS + 1], along[GT_ROOM(GT_STATES)], sum;
    gt_gaps gaps;
    int i, j, k, more, put = 0;
    if (!GT_TURNS || gt_look_at_gaps(it, &gaps) != GT_OK) return 0;
    for (i = 0, more = GT_TURNS; i < GT_TURNS; i++) {
        const int second = gt_turn_counts[i] ? more++ : i;
        for (k = i;; k = second) {
            const double left = gaps.left[k];
            if (gaps.rates[k] < 0 && left <= -GT_FORESIGHT * size * gaps.rates[k] &&
                left <= GT_LEFT * it->now.tolerance * gaps.noise[k] / GT_ROUNDING) {
                for (sum = 0, j = 0; j < GT_STATES; j++) {
                    gt_clear_direction(it);
                    it->dx[j] = 1;
                    if (GT_TURNS_OF_BLOCKS && gt_factors(it) == GT_OK) gt_along_states(it, 0);
                    gt_turning_rates(it->a, slopes, it->w);
                    along[j] = slopes[i];
                    sum += along[j] * along[j];
                }
                /* away from the side that holds: down, but up where a mode is 0 or a count is left above */
                for (j = 0; j < GT_STATES && sum > 0; j++)
                    it->now.x[j] += (k != i || !(gt_turn_counts[i] || it->now.m[GT_FRICTIONS + i]) ? 1 : -1) * along[j] *
                                    (left + 2 * gaps.noise[k]) / sum;
                put |= sum > 0;
                it->now.stale = it->outputs_stale = 1;
                break;
            }
            if (k == second) break;
        }
    }
    return put;
}
