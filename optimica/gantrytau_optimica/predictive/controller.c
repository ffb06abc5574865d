/* Predictive control in plain C: a plan shifted and linearised, its quadratic program, one iteration after the other.
 *
 * What is there in Python under the same names: the stages (stages.py), moves of inputs (moves.py), the program
 * (horizon_qp.py), the steps (mpc.py). The program is solved by a primal-dual interior-point method with Mehrotra's
 * predictor, whose linear systems are Riccati recursions along the stages (Rao, Wright and Rawlings, 1998). All loops have
 * bounds that are known when this is compiled; there is no heap. MPC_YIELD, a compliance of limits in the linear systems alone
 * (the proximal method of multipliers), keeps these well-conditioned and moves no solution.
 */
#include "controller.h"
@POINT@
#include <math.h>
#include <string.h>

#define NX MPC_NX
#define NZ MPC_NZ
#define NU MPC_NU
#define NC MPC_NC
#define NL MPC_NL
#define NY MPC_NY
#define NW MPC_NW
#define NV MPC_NV
#define NQ MPC_NQ
#define NB MPC_NB
#define NE MPC_NE
#define NI MPC_NI
#define N MPC_N
#define ROOM(n) MPC_ROOM(n)
#define FOR(i, n) for (i = 0; i < (n); i++)

/* A limit of a stage of the program: sign * (limit along the path, input, its move, or slack) <= sign * bound. */
typedef enum { MPC_PATH, MPC_INPUT, MPC_MOVE, MPC_SLACKNESS } mpc_kind;
typedef struct { mpc_kind kind; int point, index, sign, soft; double bound; } mpc_row;

@TABLES@
static const double mpc_nodes[2] = {1. / 3., 1.}, mpc_matrix[2][2] = {{5. / 12., -1. / 12.}, {3. / 4., 1. / 4.}};

/* Solve A X = B for n unknowns and m right sides by elimination with pivots; X in B. 0 if A is singular. */
static int mpc_solve(int n, int m, double *A, double *B) {
    int i, j, k;
    FOR(k, n) {
        int p = k;
        for (i = k + 1; i < n; i++) if (fabs(A[i * n + k]) > fabs(A[p * n + k])) p = i;
        if (!(fabs(A[p * n + k]) > 0)) return 0;
        if (p != k) {
            FOR(j, n) { const double a = A[k * n + j]; A[k * n + j] = A[p * n + j]; A[p * n + j] = a; }
            FOR(j, m) { const double b = B[k * m + j]; B[k * m + j] = B[p * m + j]; B[p * m + j] = b; }
        }
        for (i = k + 1; i < n; i++) {
            const double f = A[i * n + k] / A[k * n + k];
            for (j = k; j < n; j++) A[i * n + j] -= f * A[k * n + j];
            FOR(j, m) B[i * m + j] -= f * B[k * m + j];
        }
    }
    for (i = n - 1; i >= 0; i--) FOR(j, m) {
        for (k = i + 1; k < n; k++) B[i * m + j] -= A[i * n + k] * B[k * m + j];
        B[i * m + j] /= A[i * n + i];
    }
    return 1;
}

/* The lower factor of a symmetric matrix, in its place; 0 where a pivot is not above zero. */
static int mpc_cholesky(int n, double *A) {
    int i, j, k;
    FOR(i, n) for (j = 0; j <= i; j++) {
        double sum = A[i * n + j];
        FOR(k, j) sum -= A[i * n + k] * A[j * n + k];
        if (i == j && !(sum > 0)) return 0;
        A[i * n + j] = i == j ? sqrt(sum) : sum / A[j * n + j];
    }
    return 1;
}

static void mpc_back(int n, const double *L, double *b) {
    int i, k;
    FOR(i, n) {
        FOR(k, i) b[i] -= L[i * n + k] * b[k];
        b[i] /= L[i * n + i];
    }
    for (i = n - 1; i >= 0; i--) {
        for (k = i + 1; k < n; k++) b[i] -= L[k * n + i] * b[k];
        b[i] /= L[i * n + i];
    }
}

/* Negative eigenvalues of a symmetric matrix at zero (Jacobi's rotations), unless there are none; see `convex`. */
static void mpc_convex(double H[NV][NV]) {
    double L[NV][NV], V[NV][NV], D[NV][NV], largest = 1e-300;
    int i, j, k, sweep;
    FOR(i, NV) FOR(j, NV) largest = fmax(largest, fabs(H[i][j]));
    FOR(i, NV) FOR(j, NV) L[i][j] = H[i][j] + (i == j) * 1e-12 * largest;
    if (mpc_cholesky(NV, &L[0][0])) return;
    FOR(i, NV) FOR(j, NV) D[i][j] = (H[i][j] + H[j][i]) / 2, V[i][j] = i == j;
    FOR(sweep, 12) FOR(i, NV) for (j = i + 1; j < NV; j++) {
        double t, c, s;
        if (!(fabs(D[i][j]) > 1e-300)) continue;
        t = (D[j][j] - D[i][i]) / (2 * D[i][j]);
        t = (t >= 0 ? 1 : -1) / (fabs(t) + sqrt(t * t + 1));
        c = 1 / sqrt(t * t + 1), s = t * c;
        FOR(k, NV) { const double a = D[k][i], b = D[k][j]; D[k][i] = c * a - s * b, D[k][j] = s * a + c * b; }
        FOR(k, NV) { const double a = D[i][k], b = D[j][k]; D[i][k] = c * a - s * b, D[j][k] = s * a + c * b; }
        FOR(k, NV) { const double a = V[k][i], b = V[k][j]; V[k][i] = c * a - s * b, V[k][j] = s * a + c * b; }
    }
    FOR(i, NV) FOR(j, NV) {
        H[i][j] = 0;
        FOR(k, NV) H[i][j] += V[i][k] * fmax(D[k][k], 0) * V[j][k];
    }
}

/* Hessian and gradient of a cost by (x, u): those by some signals of a point, whose rows T gives, added with a weight. */
static void mpc_cost(double weight, const double T[NY][1 + NV], int n, const int *some, const double *curved,
                     const double *gradient, double H[NV][NV], double g[NV]) {
    double bent[ROOM(NY)][1 + NV];
    int i, j, k;
    FOR(i, n) FOR(j, 1 + NV) {
        bent[i][j] = 0;
        FOR(k, n) bent[i][j] += curved[i + n * k] * T[some[k]][j]; /* CasADi writes column after column */
    }
    FOR(j, NV) {
        FOR(i, NY) g[j] += weight * T[i][1 + j] * gradient[i];
        FOR(i, n) g[j] += weight * T[some[i]][1 + j] * bent[i][0];
        FOR(k, NV) FOR(i, n) H[j][k] += weight * T[some[i]][1 + j] * bent[i][1 + k];
    }
}

#define J(i, j) jacobian[(i) + (NX + NZ) * (j)] /* of the equations of a point by its signals */

/* A stage that begins at time t linearised at x, w, u, with the estimates that are known; 0 where its equations are singular or a number is not finite. See HorizonStages.linear. */
static int mpc_linearise(const double *x, const double *w, const double *u, double t, const double *known,
                         mpc_linear *to) {
    double y[2][NY], e[2][NX + NZ], jacobian[(NX + NZ) * NY], gradient[2][NY], curved[2][ROOM(NC * NC)];
    double rows[ROOM(NL)], slopes[ROOM(NL) * NY], end_g[NY], end_H[ROOM(MPC_END * NY * NY)], z[2][ROOM(NZ)][1 + NV], limits[2][ROOM(NL)][1 + NY];
    double left[2 * NX][2 * NX], moved[2 * NX][1 + NV], f[2][NX][1 + NV], all;
    int i, j, k, p, q;
    FOR(p, 2) {
        double at = t + MPC_PERIOD * mpc_nodes[p], A[ROOM(NZ * NZ)];
        const double *given[3];
        double *found[8], unused[ROOM(MPC_WORK)];
        memcpy(y[p], w + p * (NX + NZ), (NX + NZ) * sizeof(double));
        memcpy(y[p] + NX + NZ, u, NU * sizeof(double));
        given[0] = y[p], given[1] = &at, given[2] = known;
        found[0] = e[p], found[1] = jacobian, found[2] = gradient[p], found[3] = curved[p], found[4] = rows, found[5] = slopes;
        found[6] = end_g, found[7] = end_H;
        if (mpc_point(given, found, NULL, unused, 0)) return 0;
        FOR(i, NL) {
            limits[p][i][0] = rows[i];
            FOR(j, NY) limits[p][i][1 + j] = slopes[i + NL * j];
        }
        /* algebraics by (1, x, u) of their point */
        FOR(i, NZ) {
            FOR(j, NZ) A[i * NZ + j] = J(NX + i, NX + j);
            z[p][i][0] = -e[p][NX + i];
            FOR(j, NX) z[p][i][1 + j] = -J(NX + i, j);
            FOR(j, NU) z[p][i][1 + NX + j] = -J(NX + i, NX + NZ + j);
        }
        if (!mpc_solve(NZ, 1 + NV, A, &z[p][0][0])) return 0;
        FOR(i, NX) {
            f[p][i][0] = e[p][i];
            FOR(j, NX) f[p][i][1 + j] = J(i, j);
            FOR(j, NU) f[p][i][1 + NX + j] = J(i, NX + NZ + j);
            FOR(j, 1 + NV) FOR(k, NZ) f[p][i][j] += J(i, NX + k) * z[p][k][j];
        }
    }
    /* the states of both points by (1, x, u) of the stage */
    FOR(p, 2) FOR(i, NX) {
        const int row = p * NX + i;
        FOR(j, 2 * NX) left[row][j] = row == j;
        moved[row][0] = x[i] - y[p][i];
        FOR(j, NX) moved[row][1 + j] = i == j;
        FOR(j, NU) moved[row][1 + NX + j] = 0;
        FOR(q, 2) {
            FOR(j, NX) left[row][q * NX + j] -= mpc_matrix[p][q] * f[q][i][1 + j];
            moved[row][0] += mpc_matrix[p][q] * f[q][i][0];
            FOR(j, NU) moved[row][1 + NX + j] += mpc_matrix[p][q] * f[q][i][1 + NX + j];
        }
    }
    if (!mpc_solve(2 * NX, 1 + NV, &left[0][0], &moved[0][0])) return 0;
    memset(to, 0, sizeof *to);
    FOR(p, 2) {
        FOR(j, 1 + NV) {
            FOR(i, NX) to->T[p][i][j] = moved[p * NX + i][j];
            FOR(i, NZ) {
                to->T[p][NX + i][j] = j ? 0 : z[p][i][0];
                if (j > NX) to->T[p][NX + i][j] += z[p][i][j];
                FOR(k, NX) to->T[p][NX + i][j] += z[p][i][1 + k] * moved[p * NX + k][j];
            }
            FOR(i, NU) to->T[p][NX + NZ + i][j] = j == 1 + NX + i;
        }
        mpc_cost(MPC_PERIOD * mpc_matrix[1][p], to->T[p], NC, mpc_costly, curved[p], gradient[p], to->H, to->g);
        FOR(i, NL) FOR(j, 1 + NV) {
            to->rows[p][i][j] = j ? 0 : limits[p][i][0];
            FOR(k, NY) to->rows[p][i][j] += limits[p][i][1 + k] * to->T[p][k][j];
        }
    }
    mpc_convex(to->H);
    if (MPC_END) mpc_cost(1, to->T[1], NY, mpc_every, end_H, end_g, to->end_H, to->end_g);
    for (i = 0, all = 0; i < (int)(sizeof *to / sizeof(double)); i++) all += 0 * ((const double *)to)[i];
    return isfinite(all);
}

/* ---- The program of the horizon: see horizon_qp.py, and moves.py for what is added to its stages. */

/* A row of the limits of a stage: sign * (row of T, or input) <= bound, softened or not (soft: its slack from 1, or 0). */
static void mpc_limit(mpc_stage *s, int i, const mpc_row *row, const double *line, double value) {
    int j;
    FOR(j, NE) s->G[i][j] = row->sign * line[j];
    if (row->soft) s->G[i][NQ + NU + row->soft - 1] = -1;
    s->q[i] = row->sign * (row->bound - value);
}

/* Stage k from its linearisation; last, x_next: state at its end by its own unknowns, and by the plan; u: planned; o: the
 * planned input before, less u. */
static void mpc_assemble(mpc_stage *s, int k, mpc_linear *linear, const double *last, const double *x_next, const double *u,
                         const double *o) {
    const int chosen = mpc_chosen[k];
    double still[NU], T[NV][NE], line[NE], offset[NV], H[NV][NE];
    int i, j, m;
    memset(T, 0, sizeof T), memset(s, 0, sizeof *s), memset(offset, 0, sizeof offset);
    FOR(i, NX) T[i][i] = 1;
    FOR(i, NU) {
        still[i] = chosen ? 0 : o[i], offset[NX + i] = still[i];
        T[NX + i][chosen ? NQ + i : NX + i] = 1;
    }
    if (MPC_END && k == N - 1) {
        FOR(i, NV) {
            linear->g[i] += linear->end_g[i];
            FOR(j, NV) linear->H[i][j] += linear->end_H[i][j];
        }
        mpc_convex(linear->H);
    }
    FOR(i, NV) FOR(j, NE) {
        H[i][j] = 0;
        FOR(m, NV) H[i][j] += linear->H[i][m] * T[m][j];
    }
    FOR(j, NE) FOR(i, NV) {
        double g = linear->g[i];
        FOR(m, NV) g += linear->H[i][m] * offset[m];
        s->g[j] += T[i][j] * g;
        FOR(m, NE) s->H[j][m] += T[i][j] * H[i][m];
    }
    FOR(i, NX) {
        s->b[i] = last[i] + linear->T[1][i][0] - x_next[i];
        FOR(m, NV) s->b[i] += linear->T[1][i][1 + m] * offset[m];
        FOR(j, NE) FOR(m, NV) s->M[i][j] += linear->T[1][i][1 + m] * T[m][j];
    }
    for (i = NX; i < NQ; i++) {
        s->b[i] = still[i - NX];
        FOR(j, NE) s->M[i][j] = T[i][j];
        if (chosen && mpc_weights[i - NX] > 0) { /* of the step from the input before */
            const double weight = 2 * mpc_weights[i - NX];
            const int before = i, now = NQ + i - NX;
            s->H[now][now] += weight, s->H[before][before] += weight;
            s->H[now][before] -= weight, s->H[before][now] -= weight;
            s->g[now] -= weight * o[i - NX], s->g[before] += weight * o[i - NX];
        }
    }
    FOR(i, NI) {
        const mpc_row *row = &mpc_rows[i];
        double value = 0;
        memset(line, 0, sizeof line);
        if (row->kind == MPC_PATH) {
            const double *own = linear->rows[row->point][row->index];
            value = own[0];
            FOR(m, NV) value += own[1 + m] * offset[m];
            FOR(j, NE) FOR(m, NV) line[j] += own[1 + m] * T[m][j];
        } else if (row->kind == MPC_INPUT) {
            line[NQ + row->index] = 1, value = chosen ? u[row->index] : row->bound - row->sign;
        } else if (row->kind == MPC_MOVE) {
            if (chosen) line[NQ + row->index] = 1, line[NX + row->index] = -1;
            value = chosen ? -o[row->index] : row->bound - row->sign;
        } else {
            line[NQ + NU + row->index] = 1;
        }
        mpc_limit(s, i, row, line, value);
    }
}

/* One step of the recursion: the Hessian with the limits' weights, the feedback of what is chosen, and the cost before. */
static int mpc_factor(mpc_stage *s, const double P[NQ][NQ], double ridge) {
    double F[NE][NE], PM[NQ][NE];
    int i, j, k;
    memcpy(F, s->H, sizeof F);
    FOR(i, NE) F[i][i] += ridge;
    for (i = NQ + NU; i < NE; i++) F[i][i] = s->penalty;
    FOR(k, NI) {
        const double D = 1 / (s->s[k] / s->lambda[k] + MPC_YIELD);
        FOR(i, NE) FOR(j, NE) F[i][j] += D * s->G[k][i] * s->G[k][j];
    }
    FOR(i, NQ) FOR(j, NE) {
        PM[i][j] = 0;
        FOR(k, NQ) PM[i][j] += P[i][k] * s->M[k][j];
    }
    FOR(i, NE) FOR(j, NE) FOR(k, NQ) F[i][j] += s->M[k][i] * PM[k][j];
    FOR(i, NB) FOR(j, NB) s->L[i][j] = F[NQ + i][NQ + j];
    if (!mpc_cholesky(NB, &s->L[0][0])) return 0;
    FOR(j, NQ) {
        double column[NB];
        FOR(i, NB) column[i] = s->F[i][j] = F[NQ + i][j];
        mpc_back(NB, &s->L[0][0], column);
        FOR(i, NB) s->K[i][j] = column[i];
    }
    FOR(i, NQ) FOR(j, NQ) {
        s->P[i][j] = F[i][j];
        FOR(k, NB) s->P[i][j] -= s->F[k][i] * s->K[k][j];
    }
    FOR(i, NQ) FOR(j, i) s->P[i][j] = s->P[j][i] = (s->P[i][j] + s->P[j][i]) / 2;
    return 1;
}

/* Where a step of the method leads to, v of all stages and x_N, with the factors and `aim`, the products s * lambda wanted. */
static void mpc_direction(mpc_work *work, const double *first) {
    double p[NQ], x[NQ];
    int i, j, k, n;
    memcpy(p, work->end_p, sizeof p);
    for (n = N - 1; n >= 0; n--) {
        mpc_stage *s = &work->stages[n];
        double f[NE], Pb[NQ];
        memcpy(f, s->g, sizeof f);
        for (i = NQ + NU; i < NE; i++) f[i] = s->penalty;
        FOR(k, NI) {
            const double D = 1 / (s->s[k] / s->lambda[k] + MPC_YIELD);
            const double force = s->lambda[k] + D * (s->aim[k] / s->lambda[k] - s->q[k]);
            FOR(i, NE) f[i] += s->G[k][i] * force;
        }
        FOR(i, NQ) {
            Pb[i] = p[i];
            FOR(j, NQ) Pb[i] += (n < N - 1 ? work->stages[n + 1].P[i][j] : work->end_P[i][j]) * s->b[j];
        }
        FOR(j, NE) FOR(i, NQ) f[j] += s->M[i][j] * Pb[i];
        FOR(i, NB) s->k[i] = -f[NQ + i];
        mpc_back(NB, &s->L[0][0], s->k);
        FOR(i, NQ) {
            p[i] = f[i];
            FOR(k, NB) p[i] += s->F[k][i] * s->k[k];
        }
    }
    memcpy(x, first, sizeof x);
    FOR(n, N) {
        mpc_stage *s = &work->stages[n];
        memcpy(s->to, x, sizeof x);
        FOR(i, NB) {
            s->to[NQ + i] = s->k[i];
            FOR(j, NQ) s->to[NQ + i] -= s->K[i][j] * x[j];
        }
        FOR(i, NQ) {
            x[i] = s->b[i];
            FOR(j, NE) x[i] += s->M[i][j] * s->to[j];
        }
        FOR(k, NI) {
            const double D = 1 / (s->s[k] / s->lambda[k] + MPC_YIELD);
            double beyond = s->aim[k] / s->lambda[k] - s->q[k];
            FOR(j, NE) beyond += s->G[k][j] * s->to[j];
            s->dl[k] = D * beyond;
            s->ds[k] = (s->aim[k] - s->s[k] * s->dl[k]) / s->lambda[k] - s->s[k];
        }
    }
    memcpy(work->end_to, x, sizeof x);
}

/* The longest step, at most 1, that leaves all s and lambda above zero. */
static double mpc_longest(const mpc_work *work) {
    double longest = 1;
    int n, k;
    FOR(n, N) FOR(k, NI) {
        const mpc_stage *s = &work->stages[n];
        if (s->ds[k] < 0) longest = fmin(longest, -s->s[k] / s->ds[k]);
        if (s->dl[k] < 0) longest = fmin(longest, -s->lambda[k] / s->dl[k]);
    }
    return longest;
}

/* The mean product of s and lambda a step further on. */
static double mpc_mean(const mpc_work *work, double step) {
    double sum = 0;
    int n, k;
    FOR(n, N) FOR(k, NI) {
        const mpc_stage *s = &work->stages[n];
        sum += (s->s[k] + step * s->ds[k]) * (s->lambda[k] + step * s->dl[k]);
    }
    return NI ? sum / (N * ROOM(NI - 1)) : 0;
}

static int mpc_factored(mpc_work *work, double ridge) {
    int n;
    for (n = N - 1; n >= 0; n--)
        if (!mpc_factor(&work->stages[n], n < N - 1 ? work->stages[n + 1].P : work->end_P, ridge)) return 0;
    return 1;
}

/* Solve the program of the stages from a first change of the state; 1 if it is solved. */
static int mpc_program(mpc_work *work, const double *first) {
    double largest = 1e-300, slope = 0, ridge = MPC_RIDGE, left = 1, mean = 1, missed = 0, step;
    int i, j, k, n, turn;
    FOR(n, N) FOR(i, NE) FOR(j, NE) largest = fmax(largest, fabs(work->stages[n].H[i][j]));
    FOR(i, NQ) FOR(j, NQ) largest = fmax(largest, fabs(work->end_P[i][j]));
    FOR(n, N) FOR(i, NE) slope = fmax(slope, fabs(work->stages[n].g[i]));
    if (largest < 1e-6 * slope) ridge *= largest / slope, largest = slope; /* as good as linear */
    FOR(i, NQ) {
        work->end_p[i] /= largest;
        FOR(j, NQ) work->end_P[i][j] /= largest;
        work->end_P[i][i] += ridge;
    }
    FOR(n, N) {
        mpc_stage *s = &work->stages[n];
        FOR(i, NE) {
            s->g[i] /= largest;
            FOR(j, NE) s->H[i][j] /= largest;
        }
        s->penalty = MPC_PENALTY / largest;
        FOR(k, NI) s->s[k] = s->lambda[k] = 1, s->aim[k] = 0;
    }
    if (!mpc_factored(work, ridge)) return 0;
    mpc_direction(work, first);
    FOR(n, N) FOR(k, NI) {
        mpc_stage *s = &work->stages[n];
        s->s[k] = fmax(1, s->s[k] + s->ds[k]);
    }
    FOR(n, N) memcpy(work->stages[n].v, work->stages[n].to, sizeof work->stages[n].v);
    memcpy(work->end_v, work->end_to, sizeof work->end_v);
    FOR(turn, MPC_TURNS) {
        double reached, share;
        if (NI && !mpc_factored(work, ridge)) break;
        FOR(n, N) FOR(k, NI) work->stages[n].aim[k] = 0;
        mpc_direction(work, first);
        step = mpc_longest(work), mean = mpc_mean(work, 0), reached = mpc_mean(work, step);
        share = mean > 0 ? reached / mean : 0;
        FOR(n, N) FOR(k, NI) {
            mpc_stage *s = &work->stages[n];
            s->aim[k] = share * share * share * mean - s->ds[k] * s->dl[k];
        }
        if (NI) mpc_direction(work, first);
        step = mpc_longest(work);
        step = step < 1 ? 0.995 * step : 1;
        missed = 0;
        FOR(n, N) {
            mpc_stage *s = &work->stages[n];
            FOR(j, NE) s->v[j] += step * (s->to[j] - s->v[j]);
            FOR(k, NI) {
                double beyond = (s->s[k] += step * s->ds[k]) - s->q[k];
                s->lambda[k] += step * s->dl[k];
                FOR(j, NE) beyond += s->G[k][j] * s->v[j];
                missed = fmax(missed, fabs(beyond));
            }
        }
        FOR(j, NQ) work->end_v[j] += step * (work->end_to[j] - work->end_v[j]);
        left *= 1 - step;
        mean = mpc_mean(work, 0);
        if (!(mean > MPC_CLOSE) && left < MPC_CLOSE && missed < MPC_KEPT) break;
        if (mean < MPC_GOOD && left < MPC_GOOD && missed < MPC_GOOD && step < 0.5) break; /* rounding leaves no more */
    }
    return isfinite(mean) && mean < MPC_GOOD && left < MPC_GOOD && missed < MPC_GOOD;
}

/* ---- The steps: see Mpc.step. */

static double mpc_clip(double value, double low, double high) { return fmin(fmax(value, low), high); }

/* The plan a period later, its last stage repeated. */
static void mpc_shift(controller_state *it) {
    memmove(it->plan.x[0], it->plan.x[1], N * sizeof it->plan.x[0]);
    memmove(it->plan.w[0], it->plan.w[1], (N - 1) * sizeof it->plan.w[0]);
    memmove(it->plan.u[0], it->plan.u[1], (N - 1) * sizeof it->plan.u[0]);
}

/* A first plan from a measured state: the guess, which says NAN for what is measured. */
static void mpc_guess(controller_state *it, const double *x) {
    int i, j;
    memcpy(it->plan.x, mpc_first_x, sizeof it->plan.x), memcpy(it->plan.w, mpc_first_w, sizeof it->plan.w), memcpy(it->plan.u, mpc_first_u, sizeof it->plan.u);
    FOR(i, N + 1) FOR(j, NX) if (isnan(it->plan.x[i][j])) it->plan.x[i][j] = x[j];
    FOR(i, N) FOR(j, NW) if (isnan(it->plan.w[i][j])) it->plan.w[i][j] = x[j % (NX + NZ)];
}

/* The state a period later with the inputs that are applied now, in its place; 0 if the equations have no solution. */
static int mpc_later(controller_state *it, double *x, double t) {
    double w[NW], change = INFINITY;
    mpc_linear linear;
    int i, turn;
    memcpy(w, it->plan.w[0], sizeof w);
    FOR(i, NX) w[i] = w[NX + NZ + i] = x[i];
    FOR(turn, 12) if (!(change < 1e-10)) {
        if (!mpc_linearise(x, w, it->applied, t, it->known, &linear)) return 0;
        change = 0;
        FOR(i, NW) {
            const double by = linear.T[i / (NX + NZ)][i % (NX + NZ)][0];
            w[i] += by;
            change = isfinite(by) ? fmax(change, fabs(by)) : INFINITY;
        }
        if (!isfinite(change)) return 0;
    }
    memcpy(x, w + NX + NZ, NX * sizeof(double));
    return change < 1e-10;
}

/* The horizon from time t linearised at the plan, its program loaded; 0 where equations are singular. */
static int mpc_load(controller_state *it, double t) {
    mpc_work *work = &it->work;
    double o[NU];
    int i, j, k;
    FOR(k, N) {
        FOR(i, NU) o[i] = (k ? it->plan.u[k - 1][i] : it->applied[i]) - it->plan.u[k][i];
        if (!mpc_linearise(it->plan.x[k], it->plan.w[k], it->plan.u[k], t + k * MPC_PERIOD, it->known, &work->linear)) return 0;
        FOR(i, NW) FOR(j, 1 + NV) work->unknowns[k][i][j] = work->linear.T[i / (NX + NZ)][i % (NX + NZ)][j];
        mpc_assemble(&work->stages[k], k, &work->linear, it->plan.w[k] + NX + NZ, it->plan.x[k + 1], it->plan.u[k], o);
    }
    memset(work->end_P, 0, sizeof work->end_P), memset(work->end_p, 0, sizeof work->end_p);
    FOR(i, NX) FOR(j, NX) {
        work->end_P[i][j] = mpc_rest_P[i][j];
        work->end_p[i] += mpc_rest_P[i][j] * (it->plan.x[N][j] - mpc_rest_x[j]);
    }
    return 1;
}

/* Whether a loaded plan can go on from state x; see PlannedMotion.near. */
static int mpc_near(const controller_state *it, const double *x) {
    double off = 0, size = 0, begin = 0, given = 0;
    int i, k;
    FOR(k, N) FOR(i, NW) off = fmax(off, fabs(it->work.unknowns[k][i][0])), size = fmax(size, fabs(it->plan.w[k][i]));
    FOR(i, NX) begin = fmax(begin, fabs(it->plan.x[0][i])), given = fmax(given, fabs(x[i]));
    return off < 1 + size && begin < MPC_APART * (1 + given);
}

/* The plan changed by the solution of the loaded program from state x; the largest change of an input or state, below 0 without solution. */
static double mpc_change(controller_state *it, const double *x) {
    mpc_work *work = &it->work;
    double first[NQ] = {0}, change = 0, all = 0;
    int i, j, k, m;
    FOR(i, NX) first[i] = x[i] - it->plan.x[0][i];
    if (!mpc_program(work, first)) return -1;
    for (k = N - 1; k >= 0; k--) {
        const mpc_stage *s = &work->stages[k];
        double by[1 + NV];
        by[0] = 1;
        FOR(i, NX) by[1 + i] = s->v[i], it->plan.x[k][i] += s->v[i], change = fmax(change, fabs(s->v[i]));
        FOR(i, NU) {
            const double before = k ? it->plan.u[k - 1][i] : it->applied[i];
            by[1 + NX + i] = mpc_chosen[k] ? s->v[NQ + i] : s->v[NX + i] + before - it->plan.u[k][i];
            change = fmax(change, fabs(by[1 + NX + i]));
        }
        FOR(m, NW) FOR(j, 1 + NV) it->plan.w[k][m] += work->unknowns[k][m][j] * by[j];
        FOR(i, NU) it->plan.u[k][i] += by[1 + NX + i];
    }
    FOR(i, NX) it->plan.x[N][i] += work->end_v[i], change = fmax(change, fabs(work->end_v[i]));
    FOR(k, N) {
        FOR(i, NW) all += 0 * it->plan.w[k][i];
        FOR(i, NU) all += 0 * it->plan.u[k][i];
    }
    FOR(k, N + 1) FOR(i, NX) all += 0 * it->plan.x[k][i];
    return isfinite(all) ? change : -1;
}

void controller_init(controller_state *state) {
    int i;
    memset(state, 0, sizeof *state);
    FOR(i, NU) state->applied[i] = mpc_clip(0, mpc_lower_u[i], mpc_upper_u[i]);
    FOR(i, MPC_NK) state->known[i] = mpc_known[i];
    state->ready = 1;
}

void controller_step(controller_state *state, const controller_real *given, controller_real *found) {
    controller_state *it = state;
    double x[NX], kept[NU], change = 0, t;
    int i, turn, on, begun, solved = 1;
    if (!it->ready) controller_init(it);
    t = it->steps * MPC_PERIOD, begun = it->begun, it->lost = 0;
    it->steps += 1;
    FOR(i, NX) {
        x[i] = given[i] / mpc_sizes_x[i];
        if (!isfinite(x[i])) it->lost = 1, x[i] = begun ? it->plan.x[MPC_DELAY ? 0 : 1][i] : 0;
    }
    FOR(i, MPC_NK) if (isfinite(given[NX + i])) it->known[i] = given[NX + i];
    if (it->lost && !begun) solved = 0; /* there is nothing to foretell from */
    if (!begun) mpc_guess(it, x);
    if (MPC_DELAY && solved) solved = mpc_later(it, x, t), t += MPC_PERIOD;
    if (MPC_DELAY && !begun && solved) mpc_guess(it, x);
    if (begun) mpc_shift(it);
    memcpy(kept, it->plan.u[0], sizeof kept);
    it->before = it->plan;
    if (solved) for (on = begun, change = -1; change < 0 && on >= 0; on--) {
        if (begun && !on) mpc_guess(it, x); /* the plan before leads nowhere: a first one */
        FOR(turn, on ? MPC_ITERATIONS : MPC_FIRST) {
            change = mpc_load(it, t) && (turn || !on || mpc_near(it, x)) ? mpc_change(it, x) : -1;
            if (change < MPC_STANDS) break;
        }
    }
    solved &= change >= 0;
    if (!solved) it->plan = it->before;
    it->begun = begun || solved, it->failed = !solved;
    FOR(i, NU) {
        double u = solved ? it->plan.u[0][i] : kept[i];
        u = mpc_clip(u, it->applied[i] + mpc_lower_move[i], it->applied[i] + mpc_upper_move[i]);
        it->applied[i] = mpc_clip(u, mpc_lower_u[i], mpc_upper_u[i]);
        found[i] = it->applied[i] * mpc_sizes_u[i];
    }
}

#undef NX
#undef NZ
#undef NU
#undef NC
#undef NL
#undef NY
#undef NW
#undef NV
#undef NQ
#undef NB
#undef NE
#undef NI
#undef N
#undef ROOM
#undef FOR
#undef J
