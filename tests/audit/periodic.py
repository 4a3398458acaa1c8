"""Small oscillations about steady sliding by harmonic balance: the first Lyapunov coefficient as they show it.

Nothing here knows a normal form. An oscillation of a given small amplitude a is solved for with its period and with the
option that is varied, by Newton's method on Fourier samples; the growth rate of sliding at that option is then -l a^2 up
to a^4, which several amplitudes eliminate."""
import numpy as np

import reference


class Oscillations:
    """Of a scene (options by name) in which `name` is varied; a: amplitudes of friction. `shape`: of psi, where several
    modes share the leading rate."""

    def __init__(self, p, name, a=None, shape=None, samples=12):
        self.shape = shape
        self.p, self.name, self.a, self.m, self.systems = p, name, a, samples, {}
        k = np.fft.fftfreq(samples, 1 / samples)
        k[samples // 2] = 0
        self.D = np.fft.ifft(1j * k[:, None] * np.fft.fft(np.eye(samples), axis=0), axis=0).real  # d/dphase

    def system(self, value):
        if value not in self.systems:
            self.systems[value] = reference.System(self.p | {self.name: value}, self.a)
        return self.systems[value]

    def mode(self, value):
        """The leading oscillating mode: its rate and vector, in deviations of (psi, eta, state) at the nodes."""
        rates, vectors = np.linalg.eig(self.system(value).operator())
        at = np.argmax(np.where(rates.imag > 1e-9, rates.real, -np.inf))
        if self.shape is None:
            return rates[at], vectors[:, at]
        alike = vectors[:, abs(rates - rates[at]) < 1e-9 * abs(rates[at])]
        return rates[at], alike @ np.linalg.lstsq(alike[:len(self.shape)], self.shape, rcond=None)[0]

    def rates(self, value, y):
        """d/dt of deviations y (samples, unknowns) from the sliding of that value."""
        system = self.system(value)
        u, at = system.steady + np.zeros((len(y), 1), y.dtype), system.unknowns()
        u[:, at] += y
        return system.rates(0, u)[:, at]

    def solve(self, value, a):
        """The option's value at which an oscillation of amplitude a is periodic, starting from the Hopf point's."""
        rate, q = self.mode(value)
        n = len(self.system(value).free)
        lead = np.argmax(abs(q[:n]))
        phase = 2 * np.pi * np.arange(self.m) / self.m
        y = a * np.real(np.exp(1j * phase)[:, None] * (q / q[lead])[None, :])
        x = np.concatenate([y.ravel(), [rate.imag, value]])
        wave = np.exp(-1j * phase) * 2 / self.m
        scale = np.max(abs(self.rates(value, y)))

        def residual(x):
            y = x[:-2].reshape(self.m, -1)
            first = wave @ y[:, lead]
            if np.iscomplexobj(x):  # analytic parts
                re, im = np.real(wave) @ y[:, lead], np.imag(wave) @ y[:, lead]
            else:
                re, im = first.real, first.imag
            flow = x[-2] * (self.D @ y) - self.rates(float(np.real(x[-1])), y)
            return np.concatenate([flow.ravel() / scale, [(re - a) / a, im / a]])
        for _ in range(20):
            r = residual(x)
            J = np.empty((len(x), len(x)))
            for j in range(len(x) - 1):
                e = x + 0j
                e[j] += 1e-30j
                J[:, j] = residual(e).imag / 1e-30
            h = 1e-6 * abs(x[-1])
            up, down = x.copy(), x.copy()
            up[-1] += h
            down[-1] -= h
            J[:, -1] = (residual(up) - residual(down)).real / (2 * h)
            step = np.linalg.lstsq(J, -r.real, rcond=1e-13)[0]
            x = x + step
            if np.max(abs(step)) < 1e-13 * np.max(abs(x)):
                break
        assert np.max(abs(residual(x))) < 1e-9, f"no oscillation of amplitude {a}: {np.max(abs(residual(x)))}"
        return x[-1]

    def lyapunov(self, value, a):
        """-growth/a^2 from amplitudes a, a/2 and a/4, the next order eliminated; and how far it may be off."""
        l = [-self.mode(self.solve(value, size))[0].real / size**2 for size in (a, a / 2, a / 4)]
        first, second = (4 * l[1] - l[0]) / 3, (4 * l[2] - l[1]) / 3
        return second, abs(second - first) + 1e-12 / (a / 4)**2  # the growth rate is known to round-off
