/* A program that is no Python: it loads an FMU of FMI 2.0, steps it and prints its first output. Arguments: library, GUID,
   resources as a URI, value reference, step [s]. */
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

typedef void *Instance;
typedef struct { void *log; void *(*allocate)(size_t, size_t); void (*release)(void *); void *done, *about; } Calls;
static void quiet(void *a, const char *b, int c, const char *d, const char *e, ...) {}

int main(int n, char **argument) {
    void *library = dlopen(argument[1], RTLD_NOW);
    if (!library) return puts(dlerror()), 1;
    Calls calls = {quiet, calloc, free, 0, 0};
    Instance (*make)(const char *, int, const char *, const char *, const Calls *, int, int) = dlsym(library, "fmi2Instantiate");
    int (*set_up)(Instance, int, double, double, int, double) = dlsym(library, "fmi2SetupExperiment");
    int (*enter)(Instance) = dlsym(library, "fmi2EnterInitializationMode");
    int (*leave)(Instance) = dlsym(library, "fmi2ExitInitializationMode");
    int (*step)(Instance, double, double, int) = dlsym(library, "fmi2DoStep");
    int (*get)(Instance, const unsigned *, size_t, double *) = dlsym(library, "fmi2GetReal");
    Instance fmu = make("host", 1, argument[2], argument[3], &calls, 0, 0);
    if (!fmu) return puts("no instance"), 1;
    unsigned reference = atoi(argument[4]);
    double size = atof(argument[5]), value;
    if (set_up(fmu, 0, 0, 0, 0, 0) || enter(fmu) || leave(fmu)) return puts("no start"), 1;
    for (int k = 0; k < 10; k++) {
        if (step(fmu, k * size, size, 1) || get(fmu, &reference, 1, &value)) return puts("no step"), 1;
        printf("%.17g\n", value);
    }
    fflush(stdout);
    _exit(0); /* without what libraries do at the end of a process that is no Python */
}
