# ---
# jupyter:
#   jupytext: {text_representation: {extension: .py, format_name: percent}}
#   kernelspec: {display_name: Python 3, language: python, name: python3}
# ---

# %% [markdown]
# # 2. From one speed to a map of response types
#
# A machine runs well at one speed. What happens at others, and with a gap that is a little wider? This tutorial goes
# from one run to a map.
#
# ## One speed

# %%
import matplotlib.pyplot as plt
import numpy as np

import chaosgym

beam = chaosgym.ImpactBeam(excitation_frequency=19.0, clearance=0.127e-3)
record = chaosgym.simulate(beam, cycles=100, transient=200)
print(f"peak force, upper side: {record.peak_force[:, 0].min():.2f} to {record.peak_force[:, 0].max():.2f} N")
print(chaosgym.diagnose(beam).reason)

# %% [markdown]
# ## Many speeds
#
# An orbit diagram shows the settled peak forces at every speed. One dot means that the response repeats each cycle; a
# cloud is chaos.

# %%
speeds = np.arange(10.0, 30.1, 0.25)
machines = [chaosgym.ImpactBeam(excitation_frequency=speed) for speed in speeds]
records = chaosgym.simulate_many(machines, cycles=40, transient=150)
forces = [record.peak_force[:, 0] for record in records]
figure, axes = plt.subplots(figsize=(8, 3.5), layout="constrained")
axes.plot(np.repeat(speeds, 40), np.concatenate(forces), ".", markersize=1.5, color="black")
axes.set(xlabel="excitation frequency [Hz]", ylabel="peak force [N]")
plt.show()

# %% [markdown]
# Calm and chaotic speeds alternate. A speed is only as good as its neighbours: tolerances move a real machine a
# little.
#
# ## Response types
#
# The type of a response says what tolerances do to it:
#
# - **Type I**: periodic in the whole tolerance, and nowhere a peak force more than 10 % higher.
# - **Type II**: periodic at the nominal point, but somewhere in the tolerance the force is higher or the motion
#   irregular.
# - **Type III**: chaotic at the nominal point, or periodic where periodic and chaotic points are mixed.

# %%
found = chaosgym.response_type(chaosgym.ImpactBeam(excitation_frequency=8.0), window="speed-clearance")
print(found.type, "-", found.reason)

# %% [markdown]
# ## A map
#
# `response_map` judges every point of a grid over its tolerances in speed and clearance: 25 runs a point, fewer where
# neighbours are near enough to share them.

# %%
found = chaosgym.response_map(beam, np.geomspace(6.0, 30.0, 12), np.geomspace(5e-5, 2e-4, 5), budget=400, workers=1)
code = {"I": 0, "II": 1, "III": 2, "undetermined": 3}
grid = np.array([[code[kind] for kind in row] for row in found.type])
figure, axes = plt.subplots(figsize=(7, 3.2), layout="constrained")
colours = plt.matplotlib.colors.ListedColormap(["#4477aa", "#ccbb44", "#aa3377", "#dddddd"])
mesh = axes.pcolormesh(found.speed, 1e3 * found.clearance, grid.T, cmap=colours, vmin=-0.5, vmax=3.5, shading="nearest")
axes.set(xscale="log", yscale="log", xticks=[6, 10, 15, 20, 30], yticks=[0.05, 0.1, 0.2])
axes.minorticks_off()
axes.xaxis.set_major_formatter("{x:g}")
axes.yaxis.set_major_formatter("{x:g}")
axes.set(xlabel="excitation frequency [Hz]", ylabel="clearance [mm]")
figure.colorbar(mesh, ticks=range(4), ax=axes).ax.set_yticklabels(code)
plt.show()
print(f"{found.runs} machines were run")

# %% [markdown]
# Low speeds are calm. A wider gap brings chaos at lower speeds.
#
# ## More points
#
# `chaosgym sweep` labels thousands of points, resumes after a stop, and writes Parquet:
#
# ```bash
# chaosgym sweep impact-beam --axis excitation_frequency=15:25:36 --axis clearance=0.12mm:0.13mm:3 --out map
# chaosgym dataset map map --out map.png
# ```
