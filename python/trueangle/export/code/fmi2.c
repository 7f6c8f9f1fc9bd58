PUBLIC const char *fmi2GetTypesPlatform(void) { return "default"; }

PUBLIC const char *fmi2GetVersion(void) { return "2.0"; }

PUBLIC void *fmi2Instantiate(const char *name, int kind, const char *token,
    const char *resources, const void *callbacks, int visible, int logging)
{
    return strcmp(token, "@token@") ? NULL : created();
}

PUBLIC void fmi2FreeInstance(void *me) { free(me); }

PUBLIC int fmi2SetupExperiment(void *me, int tolerance_defined, double tolerance, double start,
    int stop_defined, double stop)
{
    ((Instance *)me)->value[0] = start;
    return 0;
}

PUBLIC int fmi2EnterInitializationMode(void *me) { return 0; }

PUBLIC int fmi2Reset(void *me)
{
    reset(me);
    return 0;
}

PUBLIC int fmi2GetReal(void *me, const unsigned v[], size_t n, double x[])
{
    return get(me, v, n, x);
}

PUBLIC int fmi2SetReal(void *me, const unsigned v[], size_t n, const double x[])
{
    return set(me, v, n, x);
}

PUBLIC int fmi2GetFMUstate(void *me, void **state) { return kept(me, state); }

PUBLIC int fmi2SetFMUstate(void *me, void *state)
{
    memcpy(me, state, sizeof(Instance));
    return 0;
}

PUBLIC int fmi2FreeFMUstate(void *me, void **state)
{
    free(*state);
    *state = NULL;
    return 0;
}

PUBLIC int fmi2SerializedFMUstateSize(void *me, void *state, size_t *size)
{
    *size = sizeof(Instance);
    return 0;
}

PUBLIC int fmi2SerializeFMUstate(void *me, void *state, char bytes[], size_t size)
{
    memcpy(bytes, state, sizeof(Instance));
    return 0;
}

PUBLIC int fmi2DeSerializeFMUstate(void *me, const char bytes[], size_t size, void **state)
{
    Instance copy;
    if (size != sizeof copy) {
        return 3;
    }
    memcpy(&copy, bytes, size);
    *state = NULL;
    return kept(&copy, state);
}

typedef struct {
    int again, terminate, nominals, values, defined;
    double next;
} EventInfo;

PUBLIC int fmi2NewDiscreteStates(void *me, EventInfo *info)
{
    memset(info, 0, sizeof *info);
    return 0;
}

PUBLIC int fmi2CompletedIntegratorStep(void *me, int keep, int *event, int *terminate)
{
    *event = *terminate = 0;
    step(me);
    return 0;
}

PUBLIC int fmi2EnterContinuousTimeMode(void *me) { return continuous(me); }

PUBLIC int fmi2SetTime(void *me, double time)
{
    ((Instance *)me)->value[0] = time;
    return 0;
}

PUBLIC int fmi2DoStep(void *me, double time, double size, int keep)
{
    step(me);
    ((Instance *)me)->value[0] = time + size;
    return 0;
}

/* -- FMI 2.0: what does nothing, and what there are no variables of -- */
PUBLIC int fmi2SetDebugLogging(void *me, int on, size_t n, const char *const names[]) { return 0; }
PUBLIC int fmi2ExitInitializationMode(void *me) { return 0; }
PUBLIC int fmi2Terminate(void *me) { return 0; }
PUBLIC int fmi2EnterEventMode(void *me) { return 0; }
PUBLIC int fmi2SetContinuousStates(void *me, const double x[], size_t n) { return 0; }
PUBLIC int fmi2GetDerivatives(void *me, double x[], size_t n) { return 0; }
PUBLIC int fmi2GetEventIndicators(void *me, double x[], size_t n) { return 0; }
PUBLIC int fmi2GetContinuousStates(void *me, double x[], size_t n) { return 0; }
PUBLIC int fmi2GetNominalsOfContinuousStates(void *me, double x[], size_t n) { return 0; }
PUBLIC int fmi2CancelStep(void *me) { return 0; }
PUBLIC int fmi2GetInteger(void *me, const unsigned v[], size_t n, int x[]) { return 3; }
PUBLIC int fmi2GetBoolean(void *me, const unsigned v[], size_t n, int x[]) { return 3; }
PUBLIC int fmi2GetString(void *me, const unsigned v[], size_t n, const char *x[]) { return 3; }
PUBLIC int fmi2SetInteger(void *me, const unsigned v[], size_t n, const int x[]) { return 3; }
PUBLIC int fmi2SetBoolean(void *me, const unsigned v[], size_t n, const int x[]) { return 3; }
PUBLIC int fmi2SetString(void *me, const unsigned v[], size_t n, const char *const x[]) { return 3; }
PUBLIC int fmi2GetDirectionalDerivative(void *me, const unsigned v[], size_t n, const unsigned w[], size_t k, const double a[], double b[]) { return 3; }
PUBLIC int fmi2SetRealInputDerivatives(void *me, const unsigned v[], size_t n, const int o[], const double x[]) { return 3; }
PUBLIC int fmi2GetRealOutputDerivatives(void *me, const unsigned v[], size_t n, const int o[], double x[]) { return 3; }
PUBLIC int fmi2GetStatus(void *me, int kind, int *x) { return 3; }
PUBLIC int fmi2GetRealStatus(void *me, int kind, double *x) { return 3; }
PUBLIC int fmi2GetIntegerStatus(void *me, int kind, int *x) { return 3; }
PUBLIC int fmi2GetBooleanStatus(void *me, int kind, int *x) { return 3; }
PUBLIC int fmi2GetStringStatus(void *me, int kind, const char **x) { return 3; }
