# ---
# jupyter:
#   jupytext: {text_representation: {extension: .py, format_name: percent}}
#   kernelspec: {display_name: Python 3, language: python, name: python3}
# ---

# %% [markdown]
# # 6. What is being learned: one job, step by step
#
# The shipped agent of `chaosgym/ImpactBeamTolerance-v1` learned what beams of other clearances do at each speed. No
# sensor tells it the clearance of this one. After each step of ten cycles it reads the ten peaks of the force, the
# impacts and the next demand. From all that it read in this job it expects a share of irregular cycles at every speed.
# It goes to the speed of least expected cost: that share, 0.25 for each hertz off the demand, and a little for wear.
#
# ## The job
#
# The agent asks `cost` once a step, so shares and costs are kept there.

# %%
import matplotlib.pyplot as plt
import numpy as np

from chaosgym.control.controllers import Follow
from chaosgym.control.policies import shipped_policy
from chaosgym.control.rollout import play

name = "chaosgym/ImpactBeamTolerance-v1"
policy = shipped_policy(name)
cost_of, shares, costs = policy.cost, [], []


def keep(share, damage, demand, grid):
    """Note the irregular share and the cost expected at each speed."""
    cost = cost_of(share, damage, demand, grid)
    shares.append(share[0])
    costs.append(cost[0].copy())
    return cost


policy.cost = keep
job, usual = play(policy, name, [9]), play(Follow(), name, [9])
grid, demand, speed = policy.task.grid, job.demand[:, 0], job.speed[:, 0]
mean, scatter = job.column("mean_peak_force")[:, 0], job.column("std_peak_force")[:, 0]
for who, one in (("agent", job), ("following the demand", usual)):
    told = f"return {one.returns[0]:6.1f}, irregular {one.type_iii_share[0]:4.1%}, {one.deviation[0]:.2f} Hz off"
    print(f"{who:21} {told}, damage {one.damage[0]:.3f}")

# %% [markdown]
# ## What it expected
#
# Red: where the agent expects irregular motion, by what it has read until then. Line: the demand. Marks: the speed that
# it chose, and whether most cycles then were irregular. Below: the scatter of the ten peaks. A step that changes the
# speed scatters too, because the motion has to settle.

# %%
figure, (above, below) = plt.subplots(2, 1, figsize=(8, 5.5), height_ratios=(3, 1), sharex=True, layout="constrained")
step, wild = np.arange(len(speed)), job.type_iii[:, 0] > 0.5
image = above.pcolormesh(step, grid, np.transpose(shares), cmap="Reds", vmin=0.0, vmax=1.0, alpha=0.7)
figure.colorbar(image, ax=above, label="expected irregular share")
above.step(step, demand, where="mid", color="black", linewidth=1.0, label="demand")
for axes, values in ((above, speed), (below, scatter)):
    axes.plot(step[~wild], values[~wild], "o", color="tab:blue", markersize=3, label="regular")
    axes.plot(step[wild], values[wild], "D", color="black", markersize=4.5, label="irregular")
above.set(ylabel="speed [Hz]", ylim=(17.0, 24.5))
above.legend(loc="lower right", ncols=3, fontsize=8)
below.set(xlabel="step of ten cycles", ylabel="scatter [N]")
plt.show()

# %% [markdown]
# For fifteen steps it expects chaos at 20.25 Hz. Then the peaks at 19.5 Hz scatter by up to 4 N, and it changes its
# mind about a speed where it has not been.
#
# ## Why it left a speed
#
# Shares and costs are those by which the agent chose the step; what it read came after.

# %%
shown = (21.75, 22.25, 22.5)
places = [int(np.abs(grid - at).argmin()) for at in shown]
print("                 expected share, cost at", "".join(f"{at:9.2f} Hz  " for at in shown), "read: peak, scatter")
for k in (22, 23, 24, 25, 79, 81, 82, 83, 84, 85):
    told = "   ".join(f"{shares[k][place]:5.0%}, {costs[k][place]:.3f}" for place in places)
    print(f"step {k}: demand {demand[k]:.2f}, chose {speed[k]:.2f}    {told}    {mean[k]:.1f} N, {scatter[k]:.1f} N")

# %% [markdown]
# At the demand of 22.5 Hz it expects chaos. It tries 22.25 Hz in step 23. What it reads, 82.3 N with a scatter of
# 3.9 N, doubles the share expected there. The cost exceeds that of 21.75 Hz, and it leaves for the rest of that demand.
#
# At 22.75 Hz the same two speeds cost equally much, so it wavers, and pays: 22.25 Hz is irregular in four more steps,
# and so is the step back from it. What it learned is the map of the relatives and how readings correct it. It plans no
# step ahead, and takes none only to learn.
