/* Functions that hardly anything calls, as rows: an element of an array, a number, or an operation on the rows that stand so
 * many places before. Included by model.c. */

static double gt_part(double derivative, double change) {
    return derivative == 0 || change == 0 ? 0 : derivative * change; /* also of infinite ones, as in a branch not taken */
}

/* The results from `start` on; of their changes along the seeds of the arrays from `first` to before `last`, if any. */
static void gt_played(const double *const *a, double *restrict r, double *restrict w, int first, int last, int start, int count) {
    double *const changes = w + GT_ROWS;
    int i;
    for (i = 0; i < GT_ROWS; i++) {
        const int kind = gt_rows[i][0], x = gt_rows[i][1], y = gt_rows[i][2];
        changes[i] = 0;
        if (kind == 0) {
            w[i] = a[x][y];
            if (x >= first && x < last) changes[i] = a[x + GT_FIRST_SEED][y];
        } else if (kind == 1) {
            w[i] = gt_row_numbers[x];
        } else {
            const double operands[2] = {w[i - x], w[i - y]}, *const point = operands;
            double found[3]; /* value and derivatives */
            gt_operations[kind - 2](&point, found, NULL);
            w[i] = found[0];
            if (last > first) changes[i] = gt_part(found[1], changes[i - x]) + gt_part(found[2], changes[i - y]);
        }
    }
    for (i = 0; i < count; i++) r[i] = (last > first ? changes : w)[gt_results[start + i]];
}
