/* @NAME@: predictive controller, one step every @PERIOD@ s, a horizon of @PERIODS@. From gantrytau.
 *
 * Memory that is all zeros is a controller before its first step, which makes a first plan in up to @FIRST@ iterations of the
 * method; each further step takes @ITERATIONS@, or makes a first plan again where the one before leads nowhere. No heap, no file, no global that changes.
 */
#ifndef CONTROLLER_H
#define CONTROLLER_H
typedef double controller_real;
#define CONTROLLER_PERIOD @PERIOD@ /* s */
#define CONTROLLER_GIVEN @GIVEN@ /* @GIVEN_NAMES@ */
#define CONTROLLER_FOUND @FOUND@ /* @FOUND_NAMES@ */

@SIZES@
/* N periods; NX, NZ, NU: states, algebraics and inputs; NK: estimates; NL, NI: limits along the path, and of a stage of the program */
#define MPC_NY (MPC_NX + MPC_NZ + MPC_NU) /* signals of a point */
#define MPC_NW (2 * (MPC_NX + MPC_NZ)) /* unknowns of a stage: states and algebraics at its two points */
#define MPC_NV (MPC_NX + MPC_NU)
#define MPC_NQ (MPC_NX + MPC_MOVES * MPC_NU) /* states of the program: also the input before, where moves are limited */
#define MPC_NB (MPC_NU + MPC_SLACK) /* what a stage of the program chooses */
#define MPC_NE (MPC_NQ + MPC_NB)
#define MPC_ROOM(n) ((n) + 1) /* ISO C knows no arrays of length zero */

/* A stage linearised: signals of both points, limits, and the cost by (1, x, u); see class Linear. */
typedef struct {
    double T[2][MPC_NY][1 + MPC_NV], rows[2][MPC_ROOM(MPC_NL)][1 + MPC_NV];
    double H[MPC_NV][MPC_NV], g[MPC_NV], end_H[MPC_NV][MPC_NV], end_g[MPC_NV];
} mpc_linear;

/* A stage of the program, G v <= q, and where its solution stands: v, slacks s, multipliers lambda, and their changes. */
typedef struct {
    double H[MPC_NE][MPC_NE], g[MPC_NE], M[MPC_NQ][MPC_NE], b[MPC_NQ], G[MPC_ROOM(MPC_NI)][MPC_NE], q[MPC_ROOM(MPC_NI)], penalty;
    double s[MPC_ROOM(MPC_NI)], lambda[MPC_ROOM(MPC_NI)], aim[MPC_ROOM(MPC_NI)], ds[MPC_ROOM(MPC_NI)], dl[MPC_ROOM(MPC_NI)];
    double L[MPC_NB][MPC_NB], F[MPC_NB][MPC_NQ], K[MPC_NB][MPC_NQ], k[MPC_NB], P[MPC_NQ][MPC_NQ], v[MPC_NE], to[MPC_NE];
} mpc_stage;

typedef struct {
    mpc_stage stages[MPC_N];
    mpc_linear linear;
    double unknowns[MPC_N][MPC_NW][1 + MPC_NV], end_P[MPC_NQ][MPC_NQ], end_p[MPC_NQ], end_v[MPC_NQ], end_to[MPC_NQ];
} mpc_work;

typedef struct { double x[MPC_N + 1][MPC_NX], w[MPC_N][MPC_NW], u[MPC_N][MPC_NU]; } mpc_plan; /* scaled */

typedef struct {
    mpc_plan plan, before;
    double applied[MPC_NU], known[MPC_ROOM(MPC_NK)];
    double steps; /* until now, of which each is a period of time */
    int ready, begun;
    int lost, failed;        /* the last step: a measurement was not finite; there was no solution, the plan before holds */
    mpc_work work;
} controller_state;

void controller_init(controller_state *state);
void controller_step(controller_state *state, const controller_real *given, controller_real *found);
#endif
