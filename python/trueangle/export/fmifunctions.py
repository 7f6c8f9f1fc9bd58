"""The functions of FMI 3.0 and 2.0 around an instance: co-simulation, and model exchange."""

from __future__ import annotations

__all__ = ["fmi_functions"]

_COMMON = """\
static void *created(void)
{
    Instance *me = malloc(sizeof *me);
    if (me) {
        reset(me);
    }
    return me;
}

/* In model exchange the first reading is that at the start. */
static int continuous(Instance *me)
{
    if (!me->begun) {
        step(me);
    }
    return 0;
}

static int kept(Instance *me, void **state)
{
    if (!*state) {
        *state = malloc(sizeof *me);
    }
    if (!*state) {
        return 3;
    }
    memcpy(*state, me, sizeof *me);
    return 0;
}
"""

#: What does nothing, or is not asked for: result, name, arguments after the instance.
_IDLE_3 = [
    ("SetDebugLogging", "bool on, size_t n, const char *const names[]"),
    ("EnterEventMode", ""),
    ("Terminate", ""),
    ("EnterConfigurationMode", ""),
    ("ExitConfigurationMode", ""),
    ("EvaluateDiscreteStates", ""),
    ("EnterStepMode", ""),
    ("SetContinuousStates", "const double x[], size_t n"),
    ("GetContinuousStateDerivatives", "double x[], size_t n"),
    ("GetEventIndicators", "double x[], size_t n"),
    ("GetContinuousStates", "double x[], size_t n"),
    ("GetNominalsOfContinuousStates", "double x[], size_t n"),
]

_V = "const unsigned v[], size_t n"
_NONE_3 = [
    *(
        (f"{verb}{name}", f"{_V}, {'const ' if verb == 'Set' else ''}{kind} x[], size_t m")
        for verb in ("Get", "Set")
        for name, kind in (
            ("Float32", "float"), ("Int8", "int8_t"), ("UInt8", "uint8_t"), ("Int16", "int16_t"),
            ("UInt16", "uint16_t"), ("Int32", "int32_t"), ("UInt32", "uint32_t"),
            ("Int64", "int64_t"), ("UInt64", "uint64_t"), ("Boolean", "bool"),
        )
    ),
    ("GetString", f"{_V}, const char *x[], size_t m"),
    ("SetString", f"{_V}, const char *const x[], size_t m"),
    ("GetBinary", f"{_V}, size_t sizes[], const uint8_t *x[], size_t m"),
    ("SetBinary", f"{_V}, const size_t sizes[], const uint8_t *const x[], size_t m"),
    ("GetClock", f"{_V}, bool x[]"),
    ("SetClock", f"{_V}, const bool x[]"),
    ("GetNumberOfVariableDependencies", "unsigned v, size_t *n"),
    (
        "GetVariableDependencies",
        "unsigned v, size_t a[], unsigned b[], size_t c[], int kinds[], size_t n",
    ),
    *(
        (name, f"{_V}, const unsigned w[], size_t k, const double a[], size_t i, double b[], "
         "size_t j")
        for name in ("GetDirectionalDerivative", "GetAdjointDerivative")
    ),
    ("GetIntervalDecimal", f"{_V}, double a[], int b[]"),
    ("GetIntervalFraction", f"{_V}, uint64_t a[], uint64_t b[], int c[]"),
    ("GetShiftDecimal", f"{_V}, double a[]"),
    ("GetShiftFraction", f"{_V}, uint64_t a[], uint64_t b[]"),
    ("SetIntervalDecimal", f"{_V}, const double a[]"),
    ("SetIntervalFraction", f"{_V}, const uint64_t a[], const uint64_t b[]"),
    ("SetShiftDecimal", f"{_V}, const double a[]"),
    ("SetShiftFraction", f"{_V}, const uint64_t a[], const uint64_t b[]"),
    ("GetOutputDerivatives", f"{_V}, const int32_t o[], double x[], size_t m"),
    ("ActivateModelPartition", "unsigned clock, double time"),
]  # fmt: skip

_THIRD = """\
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
"""

_IDLE_2 = [
    ("SetDebugLogging", "int on, size_t n, const char *const names[]"),
    ("ExitInitializationMode", ""),
    ("Terminate", ""),
    ("EnterEventMode", ""),
    ("SetContinuousStates", "const double x[], size_t n"),
    ("GetDerivatives", "double x[], size_t n"),
    ("GetEventIndicators", "double x[], size_t n"),
    ("GetContinuousStates", "double x[], size_t n"),
    ("GetNominalsOfContinuousStates", "double x[], size_t n"),
    ("CancelStep", ""),
]
_NONE_2 = [
    ("GetInteger", f"{_V}, int x[]"),
    ("GetBoolean", f"{_V}, int x[]"),
    ("GetString", f"{_V}, const char *x[]"),
    ("SetInteger", f"{_V}, const int x[]"),
    ("SetBoolean", f"{_V}, const int x[]"),
    ("SetString", f"{_V}, const char *const x[]"),
    (
        "GetDirectionalDerivative",
        f"{_V}, const unsigned w[], size_t k, const double a[], double b[]",
    ),
    ("SetRealInputDerivatives", f"{_V}, const int o[], const double x[]"),
    ("GetRealOutputDerivatives", f"{_V}, const int o[], double x[]"),
    ("GetStatus", "int kind, int *x"),
    ("GetRealStatus", "int kind, double *x"),
    ("GetIntegerStatus", "int kind, int *x"),
    ("GetBooleanStatus", "int kind, int *x"),
    ("GetStringStatus", "int kind, const char **x"),
]

_SECOND = """\
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
"""


def fmi_functions(fmi: str, token: str) -> str:
    """All functions that the standard wants of a library."""
    body, idle, none = (_THIRD, _IDLE_3, _NONE_3) if fmi == "3" else (_SECOND, _IDLE_2, _NONE_2)
    rows = [
        f"PUBLIC int fmi{fmi}{name}(void *me{', ' if more else ''}{more}) {{ return {code}; }}"
        for code, functions in ((0, idle), (3, none))
        for name, more in functions
    ]
    said = f"/* -- FMI {fmi}.0: what does nothing, and what there are no variables of -- */\n"
    return _COMMON + "\n" + body.replace("@token@", token) + "\n" + said + "\n".join(rows) + "\n"
