"""Matrices of second differences, for reference.py: D2 of every order and end, unequal links, cells with a Bloch phase."""
import numpy as np


def d2(n, h=1., order=2, left="periodic", right="periodic", form="continuum"):
    """The second-difference matrix with its ends: even reflection at free ones (of the chain half a spacing beyond), and
    beyond held ones of the continuum the polynomial through the nodes beside them."""
    weights = {2: [-2, 1], 4: [-5 / 2, 4 / 3, -1 / 12], 6: [-49 / 18, 3 / 2, -3 / 20, 1 / 90],
               8: [-205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560]}[order]
    D = np.zeros((n, n))

    def parts(j):  # a value beyond an end as a combination of nodes
        if left == "periodic" or 0 <= j < n:
            return [(j % n, 1)]
        far, end, inside = (-j, left, lambda k: k) if j < 0 else (j - n + 1, right, lambda k: n - 1 - k)
        if form == "chain":
            return [(inside(far - 1), 1)]
        if end == "free":
            return [(inside(far), 1)]
        nodes = np.arange(order)
        return [(inside(k), np.prod([(-far - m) / (k - m) for m in nodes if m != k])) for k in nodes]
    for i in range(n):
        for j in range(-(order // 2), order // 2 + 1):
            for at, part in parts(i + j):
                D[i, at] += weights[abs(j)] * part
    return D / h**2


def linked(links, n, ends, form):
    """The matrix of L_{i+1/2} (psi_{i+1} - psi_i) - L_{i-1/2} (psi_i - psi_{i-1}); links behind the nodes, of a ring n."""
    i, ring = np.arange(len(links)), ends[0] == "periodic"
    G = np.eye(n, k=1)[i] - np.eye(n)[i]  # differences over the links
    G[-1, 0] += ring
    M = -G.T @ (links[:, None] * G)
    if form == "continuum" and not ring:
        M[[0, -1]] *= 2  # reflected at a free end
    return M


def bloch(n, twist):
    """D2 of a cell of n blocks whose copy to the right is exp(i twist) times as large."""
    D = -2 * np.eye(n) + 0j
    for i in range(n):
        D[i, (i + 1) % n] += np.exp(1j * twist) if i == n - 1 else 1
        D[i, i - 1] += np.exp(-1j * twist) if i == 0 else 1
    return D
