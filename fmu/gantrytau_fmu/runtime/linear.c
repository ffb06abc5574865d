/* Small dense linear systems: LU factors with row pivoting of rows scaled by their largest element. */

#define GT_LARGER(a, b) ((a) > (b) ? (a) : (b))
#define GT_LARGEST_SYSTEM GT_ROOM(GT_LARGER(GT_LARGER(GT_LARGEST_BLOCK, GT_UNKNOWNS), GT_LARGER(GT_STATES, GT_INITIAL)))
#define GT_SMALLEST_PIVOT 1e-13 /* of a scaled row: below, the rows depend on each other */

/* Factor a (n, n), stored column after column, in place. Returns the sign of its determinant, 0 if it is
 * singular or not finite. scales: 1 / largest element of each row. */
static int gt_factor(int n, double *a, int *pivots, double *scales) {
    int filled[GT_LARGEST_SYSTEM], sign = 1, count, i, j, k;
    for (i = 0; i < n; i++) scales[i] = 0;
    for (j = 0; j < n; j++)
        for (i = 0; i < n; i++) {
            const double size = fabs(a[i + j * n]);
            if (size > scales[i] || size != size) scales[i] = size; /* NaN stays */
        }
    for (i = 0; i < n; i++) {
        if (!(scales[i] > 0) || !isfinite(scales[i])) return 0;
        scales[i] = 1 / scales[i];
    }
    for (j = 0; j < n; j++)
        for (i = 0; i < n; i++) a[i + j * n] *= scales[i];
    for (k = 0; k < n; k++) {
        int best = k;
        for (i = k + 1; i < n; i++)
            if (fabs(a[i + k * n]) > fabs(a[best + k * n])) best = i;
        pivots[k] = best;
        if (!(fabs(a[best + k * n]) > GT_SMALLEST_PIVOT)) return 0;
        if (best != k) {
            sign = -sign;
            for (j = 0; j < n; j++) {
                const double kept = a[k + j * n];
                a[k + j * n] = a[best + j * n];
                a[best + j * n] = kept;
            }
        }
        if (a[k + k * n] < 0) sign = -sign;
        /* most elements of larger blocks are zero */
        for (count = 0, i = k + 1; i < n; i++)
            if (a[i + k * n] != 0) {
                a[i + k * n] /= a[k + k * n];
                filled[count++] = i;
            }
        for (j = k + 1; j < n; j++) {
            const double factor = a[k + j * n];
            if (factor != 0)
                for (i = 0; i < count; i++) a[filled[i] + j * n] -= a[filled[i] + k * n] * factor;
        }
    }
    return sign;
}

/* How far factors are from those of a singular matrix: the smallest pivot, and the smallest row relative to the
 * largest, for a row that vanishes is lost when it is scaled. */
static double gt_regularity(int n, const double *a, const double *scales) {
    double pivot = INFINITY, least = INFINITY, most = 0;
    int i;
    for (i = 0; i < n; i++) {
        pivot = fmin(pivot, fabs(a[i + i * n]));
        least = fmin(least, scales[i]);
        most = fmax(most, scales[i]);
    }
    return pivot * least / most;
}

/* Solve with the factors: b (n) becomes the solution. */
static void gt_solve_factored(int n, const double *a, const int *pivots, const double *scales, double *b) {
    int i, k;
    for (i = 0; i < n; i++) b[i] *= scales[i];
    for (k = 0; k < n; k++) {
        const double kept = b[pivots[k]];
        b[pivots[k]] = b[k];
        b[k] = kept;
    }
    for (k = 0; k < n; k++)
        if (b[k] != 0)
            for (i = k + 1; i < n; i++) b[i] -= a[i + k * n] * b[k];
    for (k = n - 1; k >= 0; k--) {
        b[k] /= a[k + k * n];
        for (i = 0; i < k; i++) b[i] -= a[i + k * n] * b[k];
    }
}
