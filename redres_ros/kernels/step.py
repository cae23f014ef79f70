"""The step of a search: the least squares that the rows of its basis leave."""

import numpy as np

from redres_ros.kernels.arithmetic import dot
from redres_ros.kernels.basis import MUCH
from redres_ros.kernels.compiled import compiled
from redres_ros.kernels.search import COUNT, Q, Search

RANK = 1e-11  # a row of A is dependent below this share of the longest one


@compiled()
def step(search: Search, A: np.ndarray, a: np.ndarray) -> np.ndarray:
    """The shortest p across the basis with the least |A (z + p) - a|, (d,)."""
    m, d = A.shape
    count = search.marks[COUNT, 1]
    rest = np.zeros(m)
    P = A.copy()  # (m, d), A made orthogonal to the basis
    largest = 0.0
    for i in range(m):
        rest[i] = a[i] - dot(A[i], search.z)
        before = dot(A[i], A[i])
        largest = max(largest, before)
        for _ in range(2):
            for k in range(count):
                along = dot(P[i], search.basis[Q, k])
                for j in range(d):
                    P[i, j] -= along * search.basis[Q, k, j]
            if dot(P[i], P[i]) > MUCH * before:
                break
    V = np.zeros((min(m, d - count), d))  # orthonormal rows, P = B V
    B = np.zeros((m, len(V)))
    rank = 0
    while rank < len(V):
        longest = 0
        square = 0.0
        for i in range(m):
            if dot(P[i], P[i]) > square:
                longest = i
                square = dot(P[i], P[i])
        if not square > RANK**2 * largest:
            break
        for j in range(d):
            V[rank, j] = P[longest, j] / np.sqrt(square)
        for i in range(m):
            B[i, rank] = dot(P[i], V[rank])
            for j in range(d):
                P[i, j] -= B[i, rank] * V[rank, j]
        rank += 1
    t = least_squares(B, rest, rank)
    p = np.zeros(d)
    for k in range(rank):
        for j in range(d):
            p[j] += t[k] * V[k, j]
    return p


@compiled()
def least_squares(B: np.ndarray, rest: np.ndarray, rank: int) -> np.ndarray:
    """The t (rank,) with the least |B t - rest| for the first columns of B. Both are used up."""
    m = len(B)
    U = np.zeros((rank, rank + 1))
    for k in range(rank):  # modified Gram-Schmidt on the columns of [B rest]
        for i in range(m):
            U[k, k] += B[i, k] ** 2
        U[k, k] = np.sqrt(U[k, k])
        for i in range(m):
            B[i, k] /= U[k, k]
        for c in range(k + 1, rank):
            for i in range(m):
                U[k, c] += B[i, k] * B[i, c]
            for i in range(m):
                B[i, c] -= U[k, c] * B[i, k]
        for i in range(m):
            U[k, rank] += B[i, k] * rest[i]
        for i in range(m):
            rest[i] -= U[k, rank] * B[i, k]
    t = np.zeros(rank)
    for k in range(rank - 1, -1, -1):
        t[k] = U[k, rank]
        for c in range(k + 1, rank):
            t[k] -= U[k, c] * t[c]
        t[k] /= U[k, k]
    return t
