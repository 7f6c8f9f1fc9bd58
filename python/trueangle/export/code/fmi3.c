PUBLIC const char *fmi3GetVersion(void) { return "3.0"; }

PUBLIC void *fmi3InstantiateModelExchange(const char *name, const char *token,
    const char *resources, bool visible, bool logging, void *environment, void *log)
{
    return strcmp(token, "@token@") ? NULL : created();
}

PUBLIC void *fmi3InstantiateCoSimulation(const char *name, const char *token,
    const char *resources, bool visible, bool logging, bool events, bool early,
    const unsigned required[], size_t n, void *environment, void *log, void *update)
{
    return strcmp(token, "@token@") ? NULL : created();
}

PUBLIC void *fmi3InstantiateScheduledExecution(const char *name, const char *token,
    const char *resources, bool visible, bool logging, void *environment, void *log,
    void *clock, void *lock, void *unlock)
{
    return NULL;
}

PUBLIC void fmi3FreeInstance(void *me) { free(me); }

PUBLIC int fmi3EnterInitializationMode(void *me, bool tolerance_defined, double tolerance,
    double start, bool stop_defined, double stop)
{
    ((Instance *)me)->value[0] = start;
    return 0;
}

PUBLIC int fmi3ExitInitializationMode(void *me) { return 0; }

PUBLIC int fmi3Reset(void *me)
{
    reset(me);
    return 0;
}

PUBLIC int fmi3GetFloat64(void *me, const unsigned v[], size_t n, double x[], size_t m)
{
    return n == m ? get(me, v, n, x) : 3;
}

PUBLIC int fmi3SetFloat64(void *me, const unsigned v[], size_t n, const double x[], size_t m)
{
    return n == m ? set(me, v, n, x) : 3;
}

PUBLIC int fmi3GetFMUState(void *me, void **state) { return kept(me, state); }

PUBLIC int fmi3SetFMUState(void *me, void *state)
{
    memcpy(me, state, sizeof(Instance));
    return 0;
}

PUBLIC int fmi3FreeFMUState(void *me, void **state)
{
    free(*state);
    *state = NULL;
    return 0;
}

PUBLIC int fmi3SerializedFMUStateSize(void *me, void *state, size_t *size)
{
    *size = sizeof(Instance);
    return 0;
}

PUBLIC int fmi3SerializeFMUState(void *me, void *state, uint8_t bytes[], size_t size)
{
    memcpy(bytes, state, sizeof(Instance));
    return 0;
}

PUBLIC int fmi3DeserializeFMUState(void *me, const uint8_t bytes[], size_t size, void **state)
{
    Instance copy;
    if (size != sizeof copy) {
        return 3;
    }
    memcpy(&copy, bytes, size);
    *state = NULL;
    return kept(&copy, state);
}

PUBLIC int fmi3UpdateDiscreteStates(void *me, bool *again, bool *terminate, bool *nominals,
    bool *values, bool *defined, double *next)
{
    *again = *terminate = *nominals = *values = *defined = false;
    return 0;
}

PUBLIC int fmi3CompletedIntegratorStep(void *me, bool keep, bool *event, bool *terminate)
{
    *event = *terminate = false;
    step(me);
    return 0;
}

PUBLIC int fmi3EnterContinuousTimeMode(void *me) { return continuous(me); }

PUBLIC int fmi3SetTime(void *me, double time)
{
    ((Instance *)me)->value[0] = time;
    return 0;
}

PUBLIC int fmi3GetNumberOfEventIndicators(void *me, size_t *n)
{
    *n = 0;
    return 0;
}

PUBLIC int fmi3GetNumberOfContinuousStates(void *me, size_t *n)
{
    *n = 0;
    return 0;
}

PUBLIC int fmi3DoStep(void *me, double time, double size, bool keep, bool *event,
    bool *terminate, bool *early, double *last)
{
    step(me);
    ((Instance *)me)->value[0] = time + size;
    *event = *terminate = *early = false;
    *last = time + size;
    return 0;
}

/* -- FMI 3.0: what does nothing, and what there are no variables of -- */
PUBLIC int fmi3SetDebugLogging(void *me, bool on, size_t n, const char *const names[]) { return 0; }
PUBLIC int fmi3EnterEventMode(void *me) { return 0; }
PUBLIC int fmi3Terminate(void *me) { return 0; }
PUBLIC int fmi3EnterConfigurationMode(void *me) { return 0; }
PUBLIC int fmi3ExitConfigurationMode(void *me) { return 0; }
PUBLIC int fmi3EvaluateDiscreteStates(void *me) { return 0; }
PUBLIC int fmi3EnterStepMode(void *me) { return 0; }
PUBLIC int fmi3SetContinuousStates(void *me, const double x[], size_t n) { return 0; }
PUBLIC int fmi3GetContinuousStateDerivatives(void *me, double x[], size_t n) { return 0; }
PUBLIC int fmi3GetEventIndicators(void *me, double x[], size_t n) { return 0; }
PUBLIC int fmi3GetContinuousStates(void *me, double x[], size_t n) { return 0; }
PUBLIC int fmi3GetNominalsOfContinuousStates(void *me, double x[], size_t n) { return 0; }
PUBLIC int fmi3GetFloat32(void *me, const unsigned v[], size_t n, float x[], size_t m) { return 3; }
PUBLIC int fmi3GetInt8(void *me, const unsigned v[], size_t n, int8_t x[], size_t m) { return 3; }
PUBLIC int fmi3GetUInt8(void *me, const unsigned v[], size_t n, uint8_t x[], size_t m) { return 3; }
PUBLIC int fmi3GetInt16(void *me, const unsigned v[], size_t n, int16_t x[], size_t m) { return 3; }
PUBLIC int fmi3GetUInt16(void *me, const unsigned v[], size_t n, uint16_t x[], size_t m) { return 3; }
PUBLIC int fmi3GetInt32(void *me, const unsigned v[], size_t n, int32_t x[], size_t m) { return 3; }
PUBLIC int fmi3GetUInt32(void *me, const unsigned v[], size_t n, uint32_t x[], size_t m) { return 3; }
PUBLIC int fmi3GetInt64(void *me, const unsigned v[], size_t n, int64_t x[], size_t m) { return 3; }
PUBLIC int fmi3GetUInt64(void *me, const unsigned v[], size_t n, uint64_t x[], size_t m) { return 3; }
PUBLIC int fmi3GetBoolean(void *me, const unsigned v[], size_t n, bool x[], size_t m) { return 3; }
PUBLIC int fmi3SetFloat32(void *me, const unsigned v[], size_t n, const float x[], size_t m) { return 3; }
PUBLIC int fmi3SetInt8(void *me, const unsigned v[], size_t n, const int8_t x[], size_t m) { return 3; }
PUBLIC int fmi3SetUInt8(void *me, const unsigned v[], size_t n, const uint8_t x[], size_t m) { return 3; }
PUBLIC int fmi3SetInt16(void *me, const unsigned v[], size_t n, const int16_t x[], size_t m) { return 3; }
PUBLIC int fmi3SetUInt16(void *me, const unsigned v[], size_t n, const uint16_t x[], size_t m) { return 3; }
PUBLIC int fmi3SetInt32(void *me, const unsigned v[], size_t n, const int32_t x[], size_t m) { return 3; }
PUBLIC int fmi3SetUInt32(void *me, const unsigned v[], size_t n, const uint32_t x[], size_t m) { return 3; }
PUBLIC int fmi3SetInt64(void *me, const unsigned v[], size_t n, const int64_t x[], size_t m) { return 3; }
PUBLIC int fmi3SetUInt64(void *me, const unsigned v[], size_t n, const uint64_t x[], size_t m) { return 3; }
PUBLIC int fmi3SetBoolean(void *me, const unsigned v[], size_t n, const bool x[], size_t m) { return 3; }
PUBLIC int fmi3GetString(void *me, const unsigned v[], size_t n, const char *x[], size_t m) { return 3; }
PUBLIC int fmi3SetString(void *me, const unsigned v[], size_t n, const char *const x[], size_t m) { return 3; }
PUBLIC int fmi3GetBinary(void *me, const unsigned v[], size_t n, size_t sizes[], const uint8_t *x[], size_t m) { return 3; }
PUBLIC int fmi3SetBinary(void *me, const unsigned v[], size_t n, const size_t sizes[], const uint8_t *const x[], size_t m) { return 3; }
PUBLIC int fmi3GetClock(void *me, const unsigned v[], size_t n, bool x[]) { return 3; }
PUBLIC int fmi3SetClock(void *me, const unsigned v[], size_t n, const bool x[]) { return 3; }
PUBLIC int fmi3GetNumberOfVariableDependencies(void *me, unsigned v, size_t *n) { return 3; }
PUBLIC int fmi3GetVariableDependencies(void *me, unsigned v, size_t a[], unsigned b[], size_t c[], int kinds[], size_t n) { return 3; }
PUBLIC int fmi3GetDirectionalDerivative(void *me, const unsigned v[], size_t n, const unsigned w[], size_t k, const double a[], size_t i, double b[], size_t j) { return 3; }
PUBLIC int fmi3GetAdjointDerivative(void *me, const unsigned v[], size_t n, const unsigned w[], size_t k, const double a[], size_t i, double b[], size_t j) { return 3; }
PUBLIC int fmi3GetIntervalDecimal(void *me, const unsigned v[], size_t n, double a[], int b[]) { return 3; }
PUBLIC int fmi3GetIntervalFraction(void *me, const unsigned v[], size_t n, uint64_t a[], uint64_t b[], int c[]) { return 3; }
PUBLIC int fmi3GetShiftDecimal(void *me, const unsigned v[], size_t n, double a[]) { return 3; }
PUBLIC int fmi3GetShiftFraction(void *me, const unsigned v[], size_t n, uint64_t a[], uint64_t b[]) { return 3; }
PUBLIC int fmi3SetIntervalDecimal(void *me, const unsigned v[], size_t n, const double a[]) { return 3; }
PUBLIC int fmi3SetIntervalFraction(void *me, const unsigned v[], size_t n, const uint64_t a[], const uint64_t b[]) { return 3; }
PUBLIC int fmi3SetShiftDecimal(void *me, const unsigned v[], size_t n, const double a[]) { return 3; }
PUBLIC int fmi3SetShiftFraction(void *me, const unsigned v[], size_t n, const uint64_t a[], const uint64_t b[]) { return 3; }
PUBLIC int fmi3GetOutputDerivatives(void *me, const unsigned v[], size_t n, const int32_t o[], double x[], size_t m) { return 3; }
PUBLIC int fmi3ActivateModelPartition(void *me, unsigned clock, double time) { return 3; }
