# ---
# jupyter:
#   jupytext: {text_representation: {extension: .py, format_name: percent}}
#   kernelspec: {display_name: Python 3, language: python, name: python3}
# ---

# %% [markdown]
# # 1. From a recording to a report
#
# You have the peak force of a joint, one number a cycle, in a CSV file. You want to know whether it repeats, and how
# long the bearing lasts. The file of this tutorial is `docs/data/peaks.csv`; put the path of your own in its place.
#
# ## Read the file
#
# The reader takes CSV with any common delimiter, Parquet, `.npy`, `.mat`, WAV and UFF. It never takes a counter or a
# time stamp for a force.

# %%
import matplotlib.pyplot as plt

import chaosgym
from chaosgym.design import Criteria
from chaosgym.design.measured import evaluate_peaks
from chaosgym.recordings.columns import choose_force
from chaosgym.recordings.judge import judge_peaks
from chaosgym.recordings.read import read_recording

recording = read_recording("../data/peaks.csv")
force = choose_force(recording, "upper")
peaks = force.values
print(force.described)

# %% [markdown]
# ## Look at it
#
# Each dot is the largest force of a cycle. A periodic response gives a few lines, one for each cycle of its period.

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3), layout="constrained")
left.plot(peaks[:200], ".", markersize=4)
left.set(xlabel="cycle", ylabel="peak force [N]")
right.plot(peaks[:-1], peaks[1:], ".", markersize=3)
right.set(xlabel="peak of a cycle [N]", ylabel="peak of the next [N]")
plt.show()

# %% [markdown]
# The dots on the right fill a cloud: the next peak depends on more than this one.
#
# ## Judge it
#
# State the largest error of your sensor. Scatter within it counts as none.

# %%
verdict = judge_peaks(peaks, sensor_error=1.0)
print(verdict.diagnosis.nature)
print(verdict.diagnosis.reason)

# %% [markdown]
# Scatter beyond the sensor's error may be a random process (load, supply, speed) or chaos. Chaos is claimed only if a
# map of the last readings makes it without noise. One peak a cycle of this beam says too little. Its model says it:

# %%
print(chaosgym.diagnose(chaosgym.ImpactBeam(excitation_frequency=30.0, clearance=0.127e-3)).words)

# %% [markdown]
# A poor sensor hides the answer, and the verdict says so.

# %%
print(judge_peaks(peaks, sensor_error=20.0).diagnosis.reason)

# %% [markdown]
# ## What follows for the bearing
#
# Single peaks can't be foretold here, but their statistics can. The life follows from the equivalent
# force (Palmgren-Miner). Its interval says what a longer recording could change.

# %%
found = evaluate_peaks(peaks, Criteria(load_rating=500.0), verdict=verdict)
print("\n".join(found.lines()))

# %%
figure, axes = plt.subplots(figsize=(6, 3), layout="constrained")
axes.hist(peaks, bins=30)
axes.axvline(found.evaluation.force, color="black", linestyle="--", label="equivalent force")
axes.axvline(found.evaluation.largest_force, color="tab:red", label="largest force")
axes.set(xlabel="peak force [N]", ylabel="cycles")
axes.legend()
plt.show()

# %% [markdown]
# A designer who takes the largest force for every cycle asks for a bearing with too much life. The *conservative*
# life above is that of such a design.
#
# ## The report
#
# One command does all of this and writes a page to hand on:
#
# ```bash
# chaosgym judge docs/data/peaks.csv --column upper --sensor-error "1 N" \
#     --load-rating "500 N" --report report.html
# ```
