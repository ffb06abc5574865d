"""Poles, transmission zeros and damping of linear systems."""

import numpy as np

ROUNDING = 1e-10  # of the largest singular value, below which a direction of a balanced system is none
FREE = 1e-13  # of the largest singular value, below which a direction of a balanced system is at rest
FREE_IN_Z = 1e-11  # the same of A - I with a period: more of it is rounding, that of the matrix exponential
SAME = 9  # digits to which sizes of poles are compared when they are sorted


def poles_of(A: np.ndarray, period: float | None) -> np.ndarray:
    """Poles of a system, sorted: those of free bodies are exactly 0, with a period exactly 1 in z.

    Free directions: null space of A (with a period of A - I) and of its powers, removed by orthogonal similarity until
    the rest has full rank. Eigenvalues alone would give +-1e-8 for a double pole at zero.
    """
    from scipy.linalg import matrix_balance

    shift = 0.0 if period is None else 1.0
    rest, count = np.asarray(matrix_balance(A - shift * np.eye(len(A)), permute=False)[0]), 0
    least = max(FREE_IN_Z * shift, FREE * (float(np.linalg.norm(rest, 2)) if rest.size else 0.0))
    while rest.size:
        _, sizes, right = np.linalg.svd(rest)
        free = int(np.sum(sizes <= least))
        if not free:
            break
        kept = right[: len(rest) - free]
        rest, count = kept @ rest @ kept.T, count + free
    if not count:
        return sorted_poles(A)
    others = np.linalg.eigvals(rest) + shift if rest.size else np.zeros(0)
    return _sorted(np.concatenate([np.full(count, shift), others]))


def sorted_poles(A: np.ndarray) -> np.ndarray:
    """Eigenvalues of A (n, n), (n,) complex, the smallest first, a negative imaginary part before its positive one."""
    return _sorted(np.linalg.eigvals(A))


def _sorted(values: np.ndarray) -> np.ndarray:
    found = np.asarray(values, dtype=complex)
    sizes = np.abs(found)
    with np.errstate(divide="ignore"):
        digits = np.where(sizes > 0, np.floor(np.log10(np.where(sizes > 0, sizes, 1.0))), 0.0)
    keys = np.round(sizes / 10.0**digits, SAME) * 10.0**digits
    return found[np.lexsort((np.imag(found), np.real(found), keys))]


def transmission_zeros(A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray) -> np.ndarray:
    """Values of s at which [[A - s I, B], [C, D]] loses rank, complex, sorted like poles.

    A (n, n), B (n, m), C (k, n), D (k, m). What maps nothing, as a system without inputs, has none. Emami-Naeini and
    Van Dooren, Computation of zeros of linear multivariable systems, Automatica 18 (1982).
    """
    if 0 in (len(A), B.shape[1], len(C)):
        return np.zeros(0, dtype=complex)
    A, B, C, D = _balanced(A, B, C, D)
    A, B, C, D = _with_full_rows(A, B, C, D)
    A, C, B, D = (M.T for M in _with_full_rows(A.T, C.T, B.T, D.T))
    if not len(A):
        return np.zeros(0, dtype=complex)
    return sorted_poles(A - B @ np.linalg.solve(D, C) if len(D) else A)


def seen_part(A: np.ndarray, B: np.ndarray, C: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A, B, C in the states alone that inputs reach and outputs see: the response is the same."""
    A, B, C, _ = _balanced(A, B, C, np.zeros((len(C), B.shape[1])), states_alone=True)
    for _ in range(2):  # what is reached, then, transposed, what is seen
        basis, rank = B, -1
        while rank < basis.shape[1]:
            rank = basis.shape[1]
            left, sizes, _ = np.linalg.svd(np.hstack([basis, A @ basis / (np.linalg.norm(A, 2) or 1.0)]))
            basis = left[:, : _rank(sizes, basis)]
        A, B, C = (basis.T @ A @ basis).T, (C @ basis).T, (basis.T @ B).T
    return A, B, C


def damping_of(poles: np.ndarray, period: float | None) -> np.ndarray:
    """-Re(s) / |s| of each pole, 1 where s = 0 is no motion at all; those of a discrete system by s = log(z) / period."""
    s = in_s(poles, period)
    sizes = np.abs(s)
    moving = np.isfinite(sizes) & (sizes > 0)
    return np.where(moving, -np.real(s) / np.where(moving, sizes, 1.0), 1.0)


def in_s(poles: np.ndarray, period: float | None) -> np.ndarray:
    """Poles in 1/s: of a discrete system log(z) / period, minus infinity for z = 0."""
    if period is None:
        return poles
    gone = poles == 0
    return np.where(gone, complex(-np.inf), np.log(np.where(gone, 1.0, poles)) / period)


def _balanced(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, states_alone: bool = False
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The system with balanced units of states, and of inputs and outputs; its zeros do not change."""
    from scipy.linalg import matrix_balance

    n = len(A)
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n] = A
    whole[:n, n] = np.linalg.norm(B, axis=1)
    whole[n, :n] = np.linalg.norm(C, axis=0)
    _, (scales, _) = matrix_balance(whole, permute=False, separate=True)
    scales = scales[:n]
    A, B, C = A / scales[:, None] * scales, B / scales[:, None], C * scales
    if states_alone:
        return A, B, C, D
    columns = np.linalg.norm(np.vstack([B, D]), axis=0)
    columns = np.where(columns > 0, columns, 1.0)
    B, D = B / columns, D / columns
    rows = np.linalg.norm(np.hstack([C, D]), axis=1)
    rows = np.where(rows > 0, rows, 1.0)
    return A, B, C / rows[:, None], D / rows[:, None]


def _with_full_rows(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A smaller system with the same zeros whose D has independent rows."""
    while True:
        left, sizes, _ = np.linalg.svd(D) if D.size else (np.eye(len(D)), np.zeros(0), None)
        rank = _rank(sizes, D, C)
        C, D = left.T @ C, left.T @ D
        rest = C[rank:]
        _, sizes, right = np.linalg.svd(rest) if rest.size else (None, np.zeros(0), np.eye(len(A)))
        seen = _rank(sizes, rest, C)
        if seen == 0:
            return A, B, C[:rank], D[:rank]
        turn = np.vstack([right[seen:], right[:seen]]).T  # first what the rest does not see
        A, B = turn.T @ A @ turn, turn.T @ B
        n = len(A) - seen
        C = np.vstack([(C[:rank] @ turn)[:, :n], A[n:, :n]])
        D = np.vstack([D[:rank], B[n:]])
        A, B = A[:n, :n], B[:n]


def _rank(sizes: np.ndarray, *terms: np.ndarray) -> int:
    largest = max((float(np.abs(M).max(initial=0.0)) for M in terms), default=0.0)
    return int(np.sum(sizes > ROUNDING * largest)) if largest else 0
