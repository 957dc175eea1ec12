"""Linear algebra of fixed order against numpy's and scipy's, on random matrices."""

import math

import numpy as np
import pytest
import scipy.linalg

from chaosgym.core import matrices

SIZES = (1, 2, 3, 5, 12, 30)


def _drawn(n, seed=0):
    """A matrix (n, n) whose rows are of very different sizes."""
    rng = np.random.default_rng([n, seed])
    return rng.normal(size=(n, n)) * np.exp(2.0 * rng.normal(size=n))[:, None]


def _near(value, expected, share=1e-12):
    np.testing.assert_allclose(value, expected, rtol=0.0, atol=share * max(1e-300, np.abs(expected).max(initial=0.0)))


@pytest.mark.parametrize(
    ("left", "right"),
    [((3,), (3,)), ((3,), (3, 4)), ((4, 3), (3,)), ((5, 4, 3), (3,)), ((3,), (5, 3, 2)), ((5, 1, 4, 3), (2, 3, 7)),
     ((0, 3), (3, 4)), ((2, 3), (3, 0)), ((2, 0), (0, 3)), ((6, 3, 3), (6, 3, 3)), ((12, 12), (12, 12))],
)  # fmt: skip
def test_products_are_those_of_matmul(left, right):
    """Vectors, matrices, stacks and empty ones, transposed ones too."""
    rng = np.random.default_rng(1)
    a, b = rng.normal(size=left), rng.normal(size=right)
    _near(matrices.product(a, b), a @ b)
    assert np.shape(matrices.product(a, b)) == np.shape(a @ b)
    if len(left) == len(right) == 2:
        _near(matrices.product(b.T, a.T), b.T @ a.T)
        _near(matrices.product(a * 1j, b), a @ b * 1j)


def test_a_product_of_shapes_that_do_not_fit_is_refused():
    """It names both shapes."""
    with pytest.raises(ValueError, match=r"shapes \(2, 3\) and \(2, 3\) have no product"):
        matrices.product(np.ones((2, 3)), np.ones((2, 3)))


@pytest.mark.parametrize("n", SIZES)
def test_equations_are_solved(n):
    """Solutions, inverses, determinants and exponentials, of stacks too."""
    a, b = _drawn(n), _drawn(n, 1)
    _near(a @ matrices.solve(a, b), b, 1e-9)
    _near(matrices.inv(np.stack([a, b])) @ np.stack([a, b]), np.stack([np.eye(n)] * 2), 1e-8)
    assert matrices.det(a) == pytest.approx(np.linalg.det(a), rel=1e-9)
    small = 3.0 * a / np.abs(a).sum()
    _near(matrices.expm(small), scipy.linalg.expm(small))
    _near(matrices.tensordot(np.ones((2, n, n)), np.stack([a] * n), 2), np.tensordot(np.ones((2, n, n)), [a] * n, 2))


def test_a_singular_matrix_is_refused():
    """As by numpy."""
    with pytest.raises(np.linalg.LinAlgError):
        matrices.inv([[1.0, 2.0], [2.0, 4.0]])


@pytest.mark.parametrize("n", SIZES)
def test_symmetric_eigenproblems_are_solved(n):
    """Values are LAPACK's; vectors solve the problem and are normed by the second matrix."""
    a, b = _drawn(n), _drawn(n, 1)
    a, b = a + a.T, b @ b.T + np.eye(n)
    values, vectors = matrices.eigh(a, b)
    _near(values, scipy.linalg.eigh(a, b, eigvals_only=True), 1e-10)
    _near(a @ vectors, b @ vectors * values, 1e-9)
    _near(vectors.T @ b @ vectors, np.eye(n), 1e-9)
    _near(matrices.eigvalsh(np.stack([a, b]))[1], np.linalg.eigvalsh(b))


@pytest.mark.parametrize("n", SIZES)
def test_general_eigenproblems_are_solved(n):
    """Values are LAPACK's, in pairs that are conjugate to the last bit; vectors have length 1 and solve the problem."""
    a = _drawn(n)
    values, vectors = matrices.eig(a)
    _near(a @ vectors, vectors * values, 1e-11)
    _near(np.linalg.norm(vectors, axis=0), np.ones(n))
    expected = np.linalg.eigvals(a)
    assert max(np.abs(expected - value).min() for value in values) < 1e-10 * np.abs(expected).max()
    assert sorted(values[values.imag > 0.0].conj().tolist(), key=abs) == sorted(
        values[values.imag < 0.0].tolist(), key=abs
    )
    np.testing.assert_array_equal(matrices.eigvals(np.stack([a, a]))[1], values)


def test_a_stiff_oscillator_keeps_the_digits_of_a_soft_one():
    """Rates of 3e4 and 2 rad/s in one system, uncoupled: both are exact to rounding."""
    system = np.zeros((4, 4))
    system[0, 1] = system[2, 3] = 1.0
    system[1, 0], system[3, 2] = -1e9, -4.0
    assert sorted(np.abs(matrices.eigvals(system))) == pytest.approx([2.0, 2.0, 1e9**0.5, 1e9**0.5], rel=1e-15)


@pytest.mark.parametrize(("m", "n"), [(1, 3), (3, 3), (6, 2), (2, 6), (0, 3), (12, 5)])
def test_singular_values_and_pseudoinverses(m, n):
    """Those of numpy, also where a row is a multiple of another."""
    a = np.random.default_rng(2).normal(size=(m, n))
    if m == 6:
        a[:, 1] = 2.0 * a[:, 0]
    left, values, right = matrices.svd(a)
    _near(left * values @ right, a)
    _near(values[: min(m, n)], np.linalg.svd(a)[1])
    _near(matrices.pinv(a), np.linalg.pinv(a), 1e-11)


def test_elementary_functions_are_those_of_the_c_library():
    """One rounding of each, whatever variants numpy has for a processor."""
    angles = np.linspace(-7.0, 7.0, 101).reshape(1, 101)
    np.testing.assert_array_equal(matrices.cos(angles), [[np.float64(math.cos(x)) for x in angles[0]]])
    assert matrices.power(3.0, range(3)).tolist() == [1.0, 3.0, 9.0]


def test_entries_below_the_range_of_numbers_do_not_matter():
    """A motion that has died out leaves entries such as 5e-324, which no power of two makes as large as others."""
    matrix = np.array([[0.5, 5e-324, 0.0], [1.0, 0.25, 2e-323], [0.0, 1.0, -0.75]])
    found = np.sort(matrices.eigvals(matrix).real)
    np.testing.assert_allclose(found, [-0.75, 0.25, 0.5], rtol=1e-14)


@pytest.mark.parametrize("size", [1e-200, 1e200])
def test_eigenvalues_scale_with_the_matrix(size):
    """A period in which everything dies out has a tiny matrix, whose squares are below the range of numbers."""
    matrix = np.array([[0.0, 1.0, 0.0], [-4.0, -0.2, 1.0], [0.5, 0.0, -3.0]])
    np.testing.assert_allclose(matrices.eigvals(size * matrix) / size, matrices.eigvals(matrix), rtol=1e-13)


@pytest.mark.parametrize("size", [0.0, 5e-324, 1e-320, 1e-310, 1e-307, 1e-160, 1e300])
def test_no_size_of_a_matrix_divides_by_zero(size):
    """Random matrices of any size have numpy's eigenvalues, up to rounding of the largest; without digits, zeros."""
    for seed in range(20):
        matrix = size * np.random.default_rng(seed).normal(size=(8, 8))
        found, expected = (np.sort_complex(one(matrix)) for one in (matrices.eigvals, np.linalg.eigvals))
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-11 * np.abs(expected).max() + 1e-307)
        symmetric = 0.5 * matrix + 0.5 * matrix.T
        values, expected = matrices.eigh(symmetric)[0], np.linalg.eigvalsh(symmetric)
        np.testing.assert_allclose(values, expected, rtol=0.0, atol=1e-11 * np.abs(expected).max() + 1e-307)


def test_slow_modes_beside_a_stiff_one_are_solved():
    """A spring that holds three slowly damped bodies: values and vectors to rounding of the whole matrix."""
    stiffness = [
        [-181887.2398316408, 133337.25424220483, -80969.49207722183],
        [133337.25424220483, -97746.40368754724, 59356.82900952904],
        [-80969.49207722183, 59356.82900952904, -36044.63298377069],
    ]
    system = np.zeros((6, 6))
    system[:3, 3:] = np.eye(3)
    system[3:, :3] = stiffness
    system[3:, 3:] = np.diag([-0.05366705630379872, -0.053667056364472145, -0.05366705629757302])
    values, vectors = matrices.eig(system)
    np.testing.assert_allclose(system @ vectors, vectors * values, rtol=0.0, atol=1e-14 * np.abs(system).max())


@pytest.mark.parametrize("size", [1e-8, -1e-8, 1e8])
def test_a_determinant_out_of_range_is_not_singular(size):
    """The stiffness of a slack beam: 80 pivots whose product is no number any more."""
    system = size * (2.0 * np.eye(80) - np.eye(80, k=1) - np.eye(80, k=-1))
    np.testing.assert_allclose(matrices.solve(system, system @ np.arange(80.0)), np.arange(80.0), atol=1e-10)
    assert np.sign(matrices.det(system)) == np.linalg.slogdet(system)[0]
