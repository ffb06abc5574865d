/* Functions of the model that the C library has, but slower. */

/* Within two units in the last place: Lambert's continued fraction near zero, exponentials elsewhere. */
static double gt_tanh(double x) {
    const double size = fabs(x), s = x * x;
    if (size < 0.5) {
        const double above = 2027025. + s * (270270. + s * (6930. + s * 36.));
        const double below = 2027025. + s * (945945. + s * (51975. + s * (630. + s)));
        return x * (above / below);
    }
    if (size > 22) return copysign(1, x);
    return copysign(1 - 2 / (exp(2 * size) + 1), x);
}
