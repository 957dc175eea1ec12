# ---
# jupyter:
#   jupytext: {text_representation: {extension: .py, format_name: percent}}
#   kernelspec: {display_name: Python 3, language: python, name: python3}
# ---

# %% [markdown]
# # 4. Chaos with contacts: what can be trusted
#
# A computer can call anything chaotic: a transient, a long period, an integrator that misplaces a touch. This
# tutorial shows what each tool proves, and where it fails. The machine is the beam, with five natural modes.
#
# ## A periodic orbit, proven
#
# Newton's method looks for a state that returns to itself. Two numbers make the proof: the *residual*, by how much
# the orbit misses itself, and the *largest multiplier*, by what factor a small deviation changes in one period.
# Below one it dies out.

# %%
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

import chaosgym
from chaosgym.diagnosis import find_periodic_orbit, largest_lyapunov_exponent
from chaosgym.series import zero_one_statistic

beam = chaosgym.ImpactBeam(n_modes=5, fitted_modes=0)
calm = replace(beam, excitation_frequency=20.0)
record = chaosgym.simulate(calm, cycles=10, transient=300)
orbit = find_periodic_orbit(calm, record.final_state, period=1)
print(f"residual {orbit.residual:.1e}, largest multiplier {orbit.largest_multiplier:.3f}, certified {orbit.certified}")

# %% [markdown]
# ## Chaos, measured
#
# The largest Lyapunov exponent is the mean growth of a small deviation. The deviation is carried through every
# contact exactly. A positive exponent, three standard errors above zero, means that deviations grow.

# %%
wild = replace(beam, excitation_frequency=30.0)
for machine in (calm, wild):
    found = largest_lyapunov_exponent(machine, cycles=400, transient=200)
    print(f"{machine.excitation_frequency} Hz: {found.per_cycle:.3f} +- {found.standard_error:.3f} a cycle")

# %% [markdown]
# The section shows the same at a glance: the state once a cycle is one point for a period, and a set with structure
# for chaos.

# %%
figure, panels = plt.subplots(1, 2, figsize=(8, 3.2), layout="constrained")
for axes, machine in zip(panels, (calm, wild), strict=True):
    run = chaosgym.simulate(machine, cycles=1500, transient=300)
    axes.plot(1e3 * run.displacement, run.velocity, ".", markersize=2)
    axes.set(title=f"{machine.excitation_frequency} Hz", xlabel="displacement [mm]", ylabel="velocity [m/s]")
    axes.set(xlim=(-0.14, -0.1), ylim=(-0.06, 0.06))
plt.show()

# %% [markdown]
# ## How a common integrator fails
#
# Runge-Kutta with a fixed step steps over the instant of touch. The error is small and the same in every cycle, or it
# is not, and then it kicks the motion at random. At 19 Hz that alone makes chaos of a periodic motion.

# %%
coarse = replace(beam, excitation_frequency=19.0)
for method in (chaosgym.RungeKutta4(steps_per_cycle=2000), chaosgym.ExactEvents()):
    verdict = chaosgym.diagnose(coarse, integrator=method)
    print(f"{type(method).__name__}: {verdict.words} ({verdict.status})")

# %% [markdown]
# `chaosgym.step_check` repeats a verdict with a finer step. A verdict that changes is worth nothing.

# %%
check = chaosgym.step_check(coarse, integrator=chaosgym.RungeKutta4(steps_per_cycle=2000))
print(f"2000 steps: {check.given.words}; finer: {check.finer.words}; settled: {check.settled}")

# %% [markdown]
# ## Tests that vote
#
# `diagnose` asks several tests, each with its own weakness. The 0-1 test works on a plain series: near 0 is regular,
# near 1 chaotic. It needs no model, and it errs on noise.

# %%
peaks = chaosgym.simulate(calm, cycles=400, transient=200).peak_force[:, 0]
noisy = peaks + np.random.default_rng(0).normal(0.0, 0.5, len(peaks))
chaotic = chaosgym.simulate(wild, cycles=400, transient=200).peak_force[:, 0]
print(f"30 Hz: {zero_one_statistic(chaotic):.2f}")
print(f"20 Hz with noise of 0.5 N: {zero_one_statistic(noisy):.2f}")

# %%
verdict = chaosgym.diagnose(wild)
print(verdict.nature, verdict.status, dict(verdict.votes))

# %% [markdown]
# The noisy record of a periodic machine scores like chaos. That is why a recording is judged by another rule, which
# asks for the sensor's error (tutorial 1).
#
# ## What to trust
#
# | claim | ground |
# |---|---|
# | periodic, *certified* | a proof for this model and these parameters |
# | periodic, *agreed* | the exponent is negative and the motion repeats; near grazing Newton's method fails |
# | chaotic | an exponent above three standard errors over a finite run; no finite run proves chaos |
# | undetermined | the run was too short, or the tests disagree |
# | the real machine does the same | only as far as its parameters are known: some here are fitted |
