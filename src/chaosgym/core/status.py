"""How a kernel ended. Kernels return one of these numbers; ``simulation`` turns all but OK into a SimulationError."""

OK = 0
DIVERGED = 1
EVENT_BUDGET = 2
STEP_TOO_COARSE = 3
STEP_BUDGET = 4
NEEDS_SET = 5

MESSAGES = {
    DIVERGED: "the motion grew beyond every bound",
    EVENT_BUDGET: "one cycle needed more contact events than its budget allows",
    STEP_BUDGET: "one cycle needs more steps than its budget allows (less stiffness, less damping, fewer modes "
    "or a higher speed need fewer)",
    STEP_TOO_COARSE: "the step is too coarse for the fastest mode in contact",
    NEEDS_SET: "one cycle visits more sets of pressed surfaces than the memory holds (fewer joints or modes need less)",
}
