/* The rig of docs/examples/rig.py as an FMU of FMI 2.0: a shaken mass between two stops, one step of the semi-implicit
   Euler method in each communication step. The parameter "trouble" lets it misbehave after a second. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

typedef struct { double speed, force, upper, lower, ran, top, x, v, turns, t; int trouble; } Rig;
enum { OK = 0, ERROR = 3 };

void *fmi2Instantiate(const char *name, int kind, const char *guid, const char *where, const void *calls, int seen, int log) {
    Rig *rig = calloc(1, sizeof(Rig));
    rig->top = 1e9;
    return rig;
}
void fmi2FreeInstance(void *c) { free(c); }
int fmi2SetupExperiment(void *c, int a, double b, double t, int d, double e) { ((Rig *)c)->t = t; return OK; }
int fmi2EnterInitializationMode(void *c) { return OK; }
int fmi2ExitInitializationMode(void *c) { return OK; }
int fmi2Terminate(void *c) { return OK; }

static double *real(Rig *rig, unsigned r) {
    double *all[] = {&rig->speed, &rig->force, &rig->upper, &rig->lower, &rig->ran, &rig->top};
    return all[r];
}
int fmi2SetReal(void *c, const unsigned *r, size_t n, const double *y) {
    for (size_t i = 0; i < n; i++) *real(c, r[i]) = y[i];
    return OK;
}
int fmi2GetReal(void *c, const unsigned *r, size_t n, double *y) {
    for (size_t i = 0; i < n; i++) y[i] = *real(c, r[i]);
    return OK;
}
int fmi2SetInteger(void *c, const unsigned *r, size_t n, const int *y) { ((Rig *)c)->trouble = y[0]; return OK; }

/* the rest of the interface, which nobody calls */
#define UNUSED(name) int name(void *c) { return ERROR; }
UNUSED(fmi2Reset) UNUSED(fmi2SetDebugLogging) UNUSED(fmi2GetInteger) UNUSED(fmi2GetBoolean) UNUSED(fmi2GetString)
UNUSED(fmi2SetBoolean) UNUSED(fmi2SetString) UNUSED(fmi2GetFMUstate) UNUSED(fmi2SetFMUstate) UNUSED(fmi2FreeFMUstate)
UNUSED(fmi2SerializedFMUstateSize) UNUSED(fmi2SerializeFMUstate) UNUSED(fmi2DeSerializeFMUstate)
UNUSED(fmi2GetDirectionalDerivative) UNUSED(fmi2SetRealInputDerivatives) UNUSED(fmi2GetRealOutputDerivatives)
UNUSED(fmi2CancelStep) UNUSED(fmi2GetStatus) UNUSED(fmi2GetRealStatus) UNUSED(fmi2GetIntegerStatus)
UNUSED(fmi2GetBooleanStatus) UNUSED(fmi2GetStringStatus)
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

int fmi2DoStep(void *c, double now, double dt, int no) {
    Rig *rig = c;
    if (fabs(now - rig->t) > 1e-9) return ERROR; /* whoever steps it must count the time right */
    if (rig->t > 1.0) {
        if (rig->trouble == 1) return ERROR;
        if (rig->trouble == 2) abort();
        if (rig->trouble == 3) for (volatile int i = 0;; i = 1) {}
        if (rig->trouble == 4) printf("{\"peaks\": 7}\n");
    }
    rig->upper = 2e5 * fmax(rig->x - 1e-3, 0.0);
    rig->lower = 2e5 * fmax(-rig->x - 1e-3, 0.0);
    rig->force = rig->upper - rig->lower;
    rig->ran = fmin(rig->speed, rig->top);
    rig->v += dt * (50.0 * sin(6.283185307179586 * rig->turns) - 2000.0 * rig->x - 5.0 * rig->v - rig->force) / 0.5;
    rig->x += dt * rig->v;
    rig->turns += dt * rig->ran;
    rig->t += dt;
    if (rig->trouble == 5 && rig->t > 1.0) rig->force = nan("");
    return OK;
}
