"""The closed form, Eq. (A.13) and (20), and what else is solved by triangular factors.

A call of numpy or LAPACK takes longer than the arithmetic of so few joints: the whole formula takes
as long as three. And scipy, with LAPACK's triangular solvers, takes a third of a second to load.
"""

import numpy as np
from numba import boolean, float64, int64, optional

from redres_ros.kernels.compiled import compiled, direct, inlined, matrix, part, vector

# Results of `closed_form`.
SOLVED = 0
SINGULAR = 1  # a direction may have to be damped, or dq is too fast: it is not the solution
INDEFINITE = 2  # W is not positive definite, or holds NaN
NOT_FINITE = 3
INCOMPLETE = 4  # solved without rows of zeros, whose velocity is not zero

# What a weight is given as.
IDENTITY = 0  # nothing: the weight is I
WEIGHT = 1  # the weight
FACTOR = 2  # the upper triangular F of the weight F'F
SQUARE = 3  # the symmetric positive definite M of the weight M M

# Task directions whose singular value is below this fraction of the largest one are damped.
SINGULAR_RATIO = 1e-3

# A row that keeps this fraction of its square, a tenth of its length, is orthogonal to the others
# after one pass, but for ten roundings.
_MUCH = 0.01

_ARRAY = float64[:, ::1]


@inlined
def _product_of_rows(A: np.ndarray, i: int, j: int) -> float:
    """The scalar product of rows i and j of A (m, n)."""
    total = 0.0
    for k in range(A.shape[1]):
        total += A[i, k] * A[j, k]
    return total


@part
def _cholesky(U: np.ndarray) -> bool:
    """Write U of A = U'U over the upper triangle of A (n, n); whether A is positive definite."""
    for i in range(len(U)):
        for j in range(i, len(U)):
            rest = U[i, j]
            for k in range(i):
                rest -= U[k, i] * U[k, j]
            if j > i:
                U[i, j] = rest / U[i, i]
                continue
            if not 0.0 < rest < np.inf:
                return False
            U[i, i] = np.sqrt(rest)
    return True


@part
def _solve_lower(U: np.ndarray, X: np.ndarray) -> None:
    """Each row x of X (k, n) becomes U'^-1 x, for an upper triangular U (n, n)."""
    for r in range(len(X)):
        for i in range(len(U)):
            for k in range(i):
                X[r, i] -= U[k, i] * X[r, k]
            X[r, i] /= U[i, i]


@part
def _solve_upper(U: np.ndarray, X: np.ndarray) -> None:
    """Each row x of X (k, n) becomes U^-1 x, for an upper triangular U (n, n)."""
    for r in range(len(X)):
        for i in range(len(U) - 1, -1, -1):
            for k in range(i + 1, len(U)):
                X[r, i] -= U[i, k] * X[r, k]
            X[r, i] /= U[i, i]


@inlined
def _solve_factor(F: np.ndarray, form: int, transposed: bool, X: np.ndarray) -> None:
    """Each row x of X (k, n) becomes F^-1 x, or F'^-1 x, for an upper triangular F (n, n); a SQUARE
    comes with F'F in the place of F.
    """
    if transposed or form == SQUARE:
        _solve_lower(F, X)
    if not transposed or form == SQUARE:
        _solve_upper(F, X)


@inlined
def _substitute(R: np.ndarray, x: np.ndarray) -> None:
    """x becomes R'^-1 x, with R (m, m) upper triangular, in 0.1 us less than `_solve_lower`."""
    for k in range(len(x)):
        for j in range(k):
            x[k] -= R[j, k] * x[j]
        x[k] /= R[k, k]


@part
def _make_orthonormal(Q: np.ndarray, R: np.ndarray) -> None:
    """The rows of Q (m, n) become orthonormal: before = R' after, with R (m, m) upper triangular.

    The lower triangle of R stays as it is.
    """
    for k in range(len(Q)):
        before = _product_of_rows(Q, k, k)
        after = before
        for j in range(k):
            R[j, k] = 0.0
        for _ in range(2):  # Gram-Schmidt, and once more where rounding may have left something
            for j in range(k):
                along = _product_of_rows(Q, j, k)
                R[j, k] += along
                for i in range(Q.shape[1]):
                    Q[k, i] -= along * Q[j, i]
            after = _product_of_rows(Q, k, k)
            if after > _MUCH * before:
                break
        R[k, k] = np.sqrt(after)
        for i in range(Q.shape[1]):
            Q[k, i] /= R[k, k]


@part
def _is_regular(R: np.ndarray, size: float) -> bool:
    """Whether no direction of a task needs damping; False also where it is a close call.

    Its R (m, m) is upper triangular. The eigenvalues of R'R other than the smallest one have a mean
    of at most trace / (m - 1). Hence the smallest one is at least det / (trace / (m - 1))^(m - 1).
    Where this is too little, as for eigenvalues of different sizes, it is at least 1 / trace of the
    inverse. Singular values are judged against `size`, or the largest one if that is larger.
    """
    m = len(R)
    trace = 0.0
    root_of_det = 1.0
    for k in range(m):
        for j in range(k + 1):
            trace += R[j, k] * R[j, k]
        root_of_det *= R[k, k]
    largest = max(trace, size * size)  # at least that of all eigenvalues
    needed = SINGULAR_RATIO * SINGULAR_RATIO * largest
    inverse_of_mean = (m - 1) / trace
    least = root_of_det * root_of_det
    for _ in range(1, m):
        least *= inverse_of_mean
    if least > needed:
        return True
    inverse = np.eye(m)
    _solve_lower(R, inverse)
    trace_of_inverse = 0.0
    for k in range(m):
        for i in range(m):
            trace_of_inverse += inverse[k, i] * inverse[k, i]
    return 1.0 / trace_of_inverse > needed


@inlined
def _are_regular(R: np.ndarray, first: int, size: float) -> bool:
    """Whether no task needs damping in what those before it leave; False also for close calls.

    With J = R'Q, the diagonal block of R that belongs to a task is its Jacobian in the null space
    of those before it. Its singular values are judged against those of the whole Jacobian, whose
    rows are as long as the columns of R. All lower tasks are judged as one: the smallest singular
    value of their common block is at most that of each, what it is judged against no smaller.
    """
    for begin in range(0, first + 1, first):  # 0 and first; numba compiles a literal 0 apart
        if begin == len(R):
            break
        end = first if begin == 0 else len(R)
        if not _is_regular(R[begin:end, begin:end], size):
            return False
        square = 0.0  # of all elements: at least that of the largest singular value
        for k in range(end, len(R)):
            for j in range(k + 1):
                square += R[j, k] * R[j, k]
        size = np.sqrt(square)
    return True


@inlined
def _add_weighted(
    Q: np.ndarray, R: np.ndarray, r: np.ndarray, F: np.ndarray, form: int, dq: np.ndarray
) -> bool:
    """Add J_W^# r of the Jacobian J = Q to dq; whether W is positive definite.

    With W = F'F and y = F dq it is the least y with J F^-1 y = r. The rows of J F^-1 are made
    orthonormal, J F^-1 = R'Q: then y = Q' R'^-1 r. That is Eq. (A.5),
    J_W^# = W^-1 J' (J W^-1 J')^-1, without squaring its condition. F is the weight as `form` says;
    Q, r and F are used up.
    """
    if form != FACTOR and not _cholesky(F):
        return False
    _solve_factor(F, form, True, Q)
    _make_orthonormal(Q, R)
    _substitute(R, r)
    y = np.empty((1, len(dq)))
    for i in range(len(dq)):
        y[0, i] = 0.0
        for k in range(len(r)):
            y[0, i] += Q[k, i] * r[k]
    _solve_factor(F, form, False, y)
    for i in range(len(dq)):
        dq[i] += y[0, i]
    return True


@inlined
def _solution(
    Q: np.ndarray,
    r: np.ndarray,
    first: int,
    W: np.ndarray | None,
    form: int,
    size: float,
    fastest: float,
    dq: np.ndarray,
) -> int:
    """Add J_W^# (dx - J b), Eq. (A.13), to dq = b.

    The task J dq = dx with J = R'Q is the same as Q dq = R'^-1 dx. Hence the result is also
    b + Q_W^# r with r = R'^-1 dx - Q b. The rows of Q are orthonormal, so without a weight
    Q^# = Q'. Q comes as J, and r as dx; both are used up.
    """
    m, n = Q.shape
    if m > n:
        return SINGULAR
    R = np.empty((m, m))
    _make_orthonormal(Q, R)  # J = R'Q
    if not _are_regular(R, first, size):
        return SINGULAR
    _substitute(R, r)
    for i in range(n):
        for k in range(m):
            r[k] -= Q[k, i] * dq[i]
    if W is not None:
        if not _add_weighted(Q, R, r, W.copy(), form, dq):
            return INDEFINITE
    else:
        for k in range(m):
            for i in range(n):
                dq[i] += Q[k, i] * r[k]
    square = 0.0
    for i in range(n):
        square += dq[i] * dq[i]
    if not np.isfinite(square):
        return NOT_FINITE
    return SOLVED if square <= fastest * fastest else SINGULAR


@direct
@compiled(
    int64(
        *(matrix(), vector(), optional(matrix()), optional(vector())),  # type: ignore[no-untyped-call]
        *(optional(matrix()), int64, float64, float64, float64[::1]),  # type: ignore[no-untyped-call]
    )
)
def closed_form(
    J_first: np.ndarray,
    dx_first: np.ndarray,
    J_lower: np.ndarray | None,
    dx_lower: np.ndarray | None,
    W: np.ndarray | None,
    form: int,
    size: float,
    fastest: float,
    dq: np.ndarray,
) -> int:
    """Add J_W^# (dx - J b), Eq. (A.13), to dq = b, with the J and dx of all tasks.

    That is also what Eq. (20) asks for wherever each task can be executed exactly in what those
    before it leave. Rows of zeros in the first task, as of a planar arm, are left out. The weight W
    is None for the identity, and else as `form` says. Singular values of the first task are
    judged against `size`, or the largest one; a dq longer than `fastest` is not the solution. The
    result is SOLVED, INCOMPLETE, SINGULAR, INDEFINITE or NOT_FINITE.
    """
    n = len(dq)
    lower = 0 if dx_lower is None else len(dx_lower)
    Q = np.empty((len(dx_first) + lower, n))
    r = np.empty(len(Q))
    first = 0
    complete = True
    for k in range(len(dx_first)):
        is_zero = True
        for i in range(n):
            Q[first, i] = J_first[k, i]
            is_zero = is_zero and J_first[k, i] == 0.0
        r[first] = dx_first[k]
        if is_zero:
            complete = complete and dx_first[k] == 0.0
        else:
            first += 1
    if first == 0:
        return SINGULAR
    m = first + lower
    if dx_lower is not None and J_lower is not None:
        for k in range(lower):
            r[first + k] = dx_lower[k]
            for i in range(n):
                Q[first + k, i] = J_lower[k, i]
    outcome = _solution(Q[:m], r[:m], first, W, form, size, fastest, dq)
    return INCOMPLETE if outcome == SOLVED and not complete else outcome


@direct
@compiled(boolean(matrix(), float64))
def is_far(J: np.ndarray, ratio: float) -> bool:
    """Whether each singular value of J (m, n) is above a fraction of the largest one.

    False also where it is a close call.
    """
    m = len(J)
    Q = J.copy()
    R = np.empty((m, m))
    _make_orthonormal(Q, R)
    square = 0.0
    for k in range(m):
        for j in range(k + 1):
            square += R[j, k] * R[j, k]
    return _are_regular(R, m, ratio / SINGULAR_RATIO * np.sqrt(square))


@compiled(boolean(matrix(), _ARRAY))
def fill_factor(W: np.ndarray, F: np.ndarray) -> bool:
    """Fill in the upper triangle of F, W = F'F; whether W (n, n) is positive definite."""
    for i in range(len(F)):
        for j in range(i, len(F)):
            F[i, j] = W[i, j]
    return _cholesky(F)


@compiled((matrix(), int64, boolean, _ARRAY))
def solve_rows(F: np.ndarray, form: int, transposed: bool, X: np.ndarray) -> None:
    """As `_solve_factor`, for an F of any order."""
    _solve_factor(F.copy(), form, transposed, X)


@direct
@compiled((float64, vector(), float64, matrix(), vector(), float64[::1]))
def free_motion(
    forgetting_factor: float, dq: np.ndarray, T: float, M: np.ndarray, n: np.ndarray, b: np.ndarray
) -> None:
    """Write lambda dq - T M^-1 n, Eq. (27) and (32), into b; NaN for an M that is not definite.

    It is the velocity after one tick without any torque, Eq. (6), and with null-space damping.
    """
    U = M.copy()
    x = np.empty((1, len(n)))
    is_definite = _cholesky(U)
    for i in range(len(n)):
        x[0, i] = -n[i] if is_definite else np.nan
    _solve_lower(U, x)
    _solve_upper(U, x)  # -M^-1 n
    for i in range(len(n)):
        b[i] = forgetting_factor * dq[i] + T * x[0, i]
