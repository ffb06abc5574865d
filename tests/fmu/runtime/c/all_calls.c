/* All functions of both versions, called rightly and wrongly, in a fixed order: all_calls. Ends with a line and code 1
 * where a status is not the one expected, or where what is refused is not explained. */
#include "driver.h"

static int failures;

static void expect(int line, const char *call, int found, int expected) {
    const int explained = found < GT_DISCARD || (lines > 0 && names_something(said));
    if (found != expected || !explained) {
        fprintf(stderr, "line %d: %s gives %d, expected %d%s\n  last line: %s\n", line, call, found, expected, explained ? "" : ", explained", said);
        failures++;
    }
    lines = 0;
}
#define OK(call) expect(__LINE__, #call, (int)(call), GT_OK)
#define BAD(call) expect(__LINE__, #call, (int)(call), GT_ERROR)

static const unsigned unknown = GT_VARIABLES + 7;
static unsigned input, output, state, rate, parameter;
static double many[GT_VARIABLES + 1], *one = many;
static unsigned all[GT_VARIABLES + 1];
static size_t reals; /* how many of all are real */

static void begin(void) {
    unsigned i;
    input = first_of(GT_INPUT), output = first_of(GT_OUTPUT), state = first_of(GT_STATE);
    rate = first_of(GT_DERIVATIVE), parameter = first_of(GT_PARAMETER);
    for (i = 0; i < GT_VARIABLES; i++)
        if (gt_variables[i].kind != GT_MODE) all[reals++] = i;
}

/* ---- Instances that are not made */

static void unborn(void) {
    const fmi2CallbackFunctions silent = {NULL, NULL, NULL, NULL, NULL};
    BAD(make(2, 1, "", GT_TOKEN, 1) ? 0 : GT_ERROR);
    BAD(make(2, 1, NULL, GT_TOKEN, 1) ? 0 : GT_ERROR);
    BAD(make(2, 0, "a", "another", 1) ? 0 : GT_ERROR);
    BAD(make(3, 0, "a", NULL, 1) ? 0 : GT_ERROR);
    BAD(make(3, 1, "", GT_TOKEN, 1) ? 0 : GT_ERROR);
    BAD(fmi3InstantiateCoSimulation("a", GT_TOKEN, NULL, 0, 0, true, 0, NULL, 0, NULL, logger_3, NULL) ? 0 : GT_ERROR);
    BAD(fmi3InstantiateScheduledExecution("a", GT_TOKEN, NULL, 0, 0, NULL, logger_3, NULL, NULL, NULL) ? 0 : GT_ERROR);
    failures += fmi2Instantiate("a", fmi2CoSimulation, "wrong", NULL, NULL, 0, 0) != NULL;
    failures += fmi2Instantiate("a", fmi2CoSimulation, "wrong", NULL, &silent, 0, 0) != NULL;
    failures += fmi3InstantiateModelExchange("a", "wrong", NULL, 0, 0, NULL, NULL) != NULL;
    failures += strcmp(fmi2GetTypesPlatform(), "default") || strcmp(fmi2GetVersion(), "2.0") || strcmp(fmi3GetVersion(), "3.0");
    failures += fmi2GetReal(NULL, all, 1, one) != fmi2Error;
    failures += fmi3GetFloat64(NULL, all, 1, one, 1) != fmi3Error;
    fmi2FreeInstance(NULL);
    fmi3FreeInstance(NULL);
}

/* ---- Version 2 */

static void states_2(void *c) {
    fmi2FMUstate saved = NULL, copy = NULL;
    size_t size = 0;
    char *bytes;
    OK(fmi2GetFMUstate(c, &saved));
    OK(fmi2GetFMUstate(c, &saved)); /* into the same memory */
    BAD(fmi2GetFMUstate(c, NULL));
    OK(fmi2SetFMUstate(c, saved));
    BAD(fmi2SetFMUstate(c, NULL));
    OK(fmi2SerializedFMUstateSize(c, saved, &size));
    BAD(fmi2SerializedFMUstateSize(c, saved, NULL));
    bytes = malloc(size);
    OK(fmi2SerializeFMUstate(c, saved, bytes, size));
    BAD(fmi2SerializeFMUstate(c, saved, bytes, size - 1));
    BAD(fmi2SerializeFMUstate(c, NULL, bytes, size));
    OK(fmi2DeSerializeFMUstate(c, bytes, size, &copy));
    OK(fmi2SetFMUstate(c, copy));
    bytes[size / 2] ^= 1;
    OK(fmi2DeSerializeFMUstate(c, bytes, size, &copy));
    BAD(fmi2SetFMUstate(c, copy));
    bytes[0] ^= 1;
    BAD(fmi2DeSerializeFMUstate(c, bytes, size, &copy));
    BAD(fmi2DeSerializeFMUstate(c, bytes, 3, &copy));
    BAD(fmi2DeSerializeFMUstate(c, NULL, size, &copy));
    BAD(fmi2DeSerializeFMUstate(c, bytes, size, NULL));
    OK(fmi2FreeFMUstate(c, &copy));
    OK(fmi2FreeFMUstate(c, &copy));
    OK(fmi2FreeFMUstate(c, &saved));
    BAD(fmi2FreeFMUstate(c, NULL));
    free(bytes);
}

static void values_2(void *c) {
    const double seed = 1, inf = (double)INFINITY, nan = (double)NAN;
    fmi2String text = "";
    int whole = 0;
    OK(fmi2GetReal(c, all, reals, many));
    OK(fmi2GetReal(c, NULL, 0, NULL));
    BAD(fmi2GetReal(c, NULL, 1, one));
    BAD(fmi2GetReal(c, all, 1, NULL));
    BAD(fmi2GetReal(c, &unknown, 1, one));
    BAD(fmi2SetReal(c, &unknown, 1, one));
    BAD(fmi2SetReal(c, &output, 1, one));
    BAD(fmi2SetReal(c, all, 1, &inf)); /* time */
    if (input < GT_VARIABLES) {
        OK(fmi2SetReal(c, &input, 1, &seed));
        BAD(fmi2SetReal(c, &input, 1, &nan));
        BAD(fmi2SetReal(c, &input, 1, &inf));
        OK(fmi2GetDirectionalDerivative(c, &rate, 1, &input, 1, &seed, one));
    }
    OK(fmi2GetDirectionalDerivative(c, &output, 1, &state, 1, &seed, one));
    OK(fmi2GetDirectionalDerivative(c, &output, 1, &parameter, 1, &seed, one));
    BAD(fmi2GetDirectionalDerivative(c, &output, 1, &output, 1, &seed, one));
    BAD(fmi2GetDirectionalDerivative(c, &output, 1, &state, 1, &nan, one));
    BAD(fmi2GetDirectionalDerivative(c, &output, 1, &state, 1, NULL, one));
    BAD(fmi2GetDirectionalDerivative(c, &output, 1, &unknown, 1, &seed, one));
    BAD(fmi2GetInteger(c, &output, 1, &whole));
    BAD(fmi2SetInteger(c, &output, 1, &whole));
    BAD(fmi2GetBoolean(c, &output, 1, &whole));
    BAD(fmi2SetBoolean(c, &output, 1, &whole));
    BAD(fmi2GetString(c, &output, 1, &text));
    BAD(fmi2SetString(c, &output, 1, &text));
    OK(fmi2GetString(c, NULL, 0, NULL));
    if (GT_FRICTIONS) {
        const unsigned friction = first_of(GT_MODE);
        OK(fmi2GetInteger(c, &friction, 1, &whole));
        BAD(fmi2GetReal(c, &friction, 1, one));
    }
}

static void cosimulation_2(void) {
    static const char *const categories[] = {"logCalls", "logEvents"}, *const wrong[] = {"log", NULL};
    void *c = make(2, 1, "cosimulation", GT_TOKEN, 1);
    fmi2Status status;
    fmi2EventInfo info;
    fmi2String text;
    int whole;
    BAD(fmi2DoStep(c, 0, 0.1, 1));
    BAD(fmi2EnterInitializationMode(c));
    BAD(fmi2GetReal(c, all, 1, one));
    BAD(fmi2SetupExperiment(c, 1, -1, 0, 0, 0));
    BAD(fmi2SetupExperiment(c, 0, 0, (double)NAN, 0, 0));
    BAD(fmi2SetupExperiment(c, 0, 0, 1, 1, 0));
    OK(fmi2SetupExperiment(c, 1, 1e-5, 0, 1, 10));
    states_2(c);
    OK(fmi2EnterInitializationMode(c));
    values_2(c);
    states_2(c);
    OK(fmi2ExitInitializationMode(c));
    OK(fmi2SetDebugLogging(c, 1, 2, categories));
    BAD(fmi2SetDebugLogging(c, 1, 1, wrong));
    BAD(fmi2SetDebugLogging(c, 1, 2, NULL));
    OK(fmi2DoStep(c, 0, 0.1, 1));
    BAD(fmi2DoStep(c, 0, 0.1, 1));
    BAD(fmi2DoStep(c, 0.1, -0.1, 1));
    BAD(fmi2DoStep(c, 0.1, 0, 1));
    BAD(fmi2DoStep(c, 0.1, (double)NAN, 1));
    BAD(fmi2DoStep(c, 0.1, (double)INFINITY, 1));
    BAD(fmi2DoStep(c, (double)NAN, 0.1, 1));
    BAD(fmi2DoStep(c, 0.1, 20, 1));
    values_2(c);
    states_2(c);
    OK(fmi2GetStatus(c, fmi2DoStepStatus, &status));
    BAD(fmi2GetStatus(c, fmi2PendingStatus, &status));
    BAD(fmi2GetStatus(c, fmi2DoStepStatus, NULL));
    OK(fmi2GetRealStatus(c, fmi2LastSuccessfulTime, one));
    BAD(fmi2GetIntegerStatus(c, fmi2Terminated, &whole));
    OK(fmi2GetBooleanStatus(c, fmi2Terminated, &whole));
    OK(fmi2GetStringStatus(c, fmi2PendingStatus, &text));
    BAD(fmi2CancelStep(c));
    BAD(fmi2SetRealInputDerivatives(c, &output, 1, &whole, one));
    BAD(fmi2GetRealOutputDerivatives(c, &output, 1, &whole, one));
    BAD(fmi2EnterEventMode(c));
    BAD(fmi2NewDiscreteStates(c, &info));
    BAD(fmi2GetContinuousStates(c, many, GT_STATES));
    OK(fmi2Terminate(c));
    BAD(fmi2DoStep(c, 0.1, 0.1, 1));
    BAD(fmi2Terminate(c));
    OK(fmi2Reset(c));
    release(c, 2);
}

static void exchange_2(void) {
    void *c = make(2, 0, "exchange", GT_TOKEN, 0);
    fmi2EventInfo info;
    int event, terminate;
    BAD(fmi2EnterContinuousTimeMode(c));
    OK(enter(c, 2, 0));
    values_2(c);
    OK(fmi2ExitInitializationMode(c));
    BAD(fmi2NewDiscreteStates(c, NULL));
    do OK(fmi2NewDiscreteStates(c, &info));
    while (info.newDiscreteStatesNeeded);
    OK(fmi2EnterContinuousTimeMode(c));
    BAD(fmi2NewDiscreteStates(c, &info));
    BAD(fmi2DoStep(c, 0, 0.1, 1));
    OK(fmi2SetTime(c, 0.01));
    BAD(fmi2SetTime(c, (double)NAN));
    OK(fmi2GetContinuousStates(c, many, GT_STATES));
    BAD(fmi2GetContinuousStates(c, NULL, GT_STATES));
    BAD(fmi2GetContinuousStates(c, many, GT_STATES + 1));
    OK(fmi2SetContinuousStates(c, many, GT_STATES));
    many[0] = (double)NAN;
    BAD(fmi2SetContinuousStates(c, many, GT_STATES));
    OK(fmi2GetDerivatives(c, many, GT_STATES));
    BAD(fmi2GetDerivatives(c, many, 0));
    OK(fmi2GetEventIndicators(c, many, GT_INDICATORS));
    BAD(fmi2GetEventIndicators(c, many, GT_INDICATORS + 1));
    OK(fmi2GetNominalsOfContinuousStates(c, many, GT_STATES));
    BAD(fmi2GetNominalsOfContinuousStates(c, NULL, GT_STATES));
    OK(fmi2CompletedIntegratorStep(c, 1, &event, &terminate));
    BAD(fmi2CompletedIntegratorStep(c, 1, NULL, &terminate));
    values_2(c);
    states_2(c);
    OK(fmi2EnterEventMode(c));
    BAD(fmi2CancelStep(c));
    OK(fmi2Terminate(c));
    BAD(fmi3GetFloat64(c, all, 1, one, 1) == fmi3Error && (lines = 1, strcpy(said, "fmi3")) ? GT_ERROR : 0); /* silent */
    release(c, 2);
}

/* ---- Version 3 */

static void states_3(void *c) {
    fmi3FMUState saved = NULL, copy = NULL;
    size_t size = 0;
    fmi3Byte *bytes;
    OK(fmi3GetFMUState(c, &saved));
    BAD(fmi3GetFMUState(c, NULL));
    OK(fmi3SetFMUState(c, saved));
    BAD(fmi3SetFMUState(c, NULL));
    OK(fmi3SerializedFMUStateSize(c, saved, &size));
    bytes = malloc(size);
    OK(fmi3SerializeFMUState(c, saved, bytes, size));
    BAD(fmi3SerializeFMUState(c, saved, bytes, size + 1));
    OK(fmi3DeserializeFMUState(c, bytes, size, &copy));
    OK(fmi3SetFMUState(c, copy));
    bytes[size - 1] ^= 1;
    OK(fmi3DeserializeFMUState(c, bytes, size, &copy));
    BAD(fmi3SetFMUState(c, copy));
    BAD(fmi3DeserializeFMUState(c, bytes, size - 1, &copy));
    OK(fmi3FreeFMUState(c, &copy));
    OK(fmi3FreeFMUState(c, &saved));
    BAD(fmi3FreeFMUState(c, NULL));
    free(bytes);
}

#define TYPE_3(type)                                            \
    BAD(fmi3Get##type(c, &output, 1, (fmi3##type *)room, 1));   \
    BAD(fmi3Set##type(c, &output, 1, (fmi3##type *)room, 1));   \
    OK(fmi3Get##type(c, NULL, 0, NULL, 0));

static void values_3(void *c) {
    const double seed = 1;
    void *room = calloc(4, 16);
    size_t sizes[2] = {0, 0};
    OK(fmi3GetFloat64(c, all, reals, many, reals));
    BAD(fmi3GetFloat64(c, all, reals, many, reals - 1));
    BAD(fmi3GetFloat64(c, &unknown, 1, one, 1));
    BAD(fmi3SetFloat64(c, &output, 1, one, 1));
    if (input < GT_VARIABLES) OK(fmi3SetFloat64(c, &input, 1, &seed, 1));
    BAD(fmi3GetInt32(c, &output, 1, room, 1));
    BAD(fmi3SetInt32(c, &output, 1, room, 1));
    TYPE_3(Float32) TYPE_3(Int8) TYPE_3(UInt8) TYPE_3(Int16) TYPE_3(UInt16) TYPE_3(UInt32) TYPE_3(Int64) TYPE_3(UInt64)
    TYPE_3(Boolean) TYPE_3(String)
    BAD(fmi3GetBinary(c, &output, 1, sizes, room, 1));
    BAD(fmi3SetBinary(c, &output, 1, sizes, room, 1));
    BAD(fmi3GetClock(c, &output, 1, room));
    BAD(fmi3SetClock(c, &output, 1, room));
    BAD(fmi3GetIntervalDecimal(c, &output, 1, room, room));
    BAD(fmi3SetIntervalDecimal(c, &output, 1, room));
    BAD(fmi3GetIntervalFraction(c, &output, 1, room, room, room));
    BAD(fmi3SetIntervalFraction(c, &output, 1, room, room));
    BAD(fmi3GetShiftDecimal(c, &output, 1, room));
    BAD(fmi3SetShiftDecimal(c, &output, 1, room));
    BAD(fmi3GetShiftFraction(c, &output, 1, room, room));
    BAD(fmi3SetShiftFraction(c, &output, 1, room, room));
    OK(fmi3GetDirectionalDerivative(c, &output, 1, &state, 1, &seed, 1, one, 1));
    BAD(fmi3GetDirectionalDerivative(c, &output, 1, &state, 1, &seed, 0, one, 1));
    OK(fmi3GetAdjointDerivative(c, &output, 1, &state, 1, &seed, 1, one, 1));
    BAD(fmi3GetAdjointDerivative(c, &output, 1, &state, 1, &seed, 1, one, 2));
    BAD(fmi3GetNumberOfVariableDependencies(c, output, sizes));
    BAD(fmi3GetVariableDependencies(c, output, sizes, room, sizes, room, 1));
    BAD(fmi3GetVariableDependencies(c, unknown, sizes, room, sizes, room, 1));
    BAD(fmi3EnterConfigurationMode(c));
    BAD(fmi3ExitConfigurationMode(c));
    BAD(fmi3ActivateModelPartition(c, 0, 0));
    free(room);
}

static void cosimulation_3(void) {
    void *c = make(3, 1, "cosimulation", GT_TOKEN, 1);
    bool event, terminate, early;
    double reached;
    fmi3Int32 order = 1;
    BAD(fmi3EnterInitializationMode(c, true, 2, 0, false, 0));
    BAD(fmi3ExitInitializationMode(c));
    OK(fmi3EnterInitializationMode(c, true, 1e-5, 0, true, 10));
    values_3(c);
    states_3(c);
    OK(fmi3ExitInitializationMode(c));
    OK(step(c, 3, 0, 0.1));
    BAD(step(c, 3, 0.1, -1));
    BAD(step(c, 3, 5, 0.1));
    BAD(fmi3DoStep(c, 0.1, 0.1, true, &event, &terminate, &early, NULL));
    BAD(fmi3DoStep(c, 0.1, 0.1, true, NULL, &terminate, &early, &reached));
    BAD(fmi3EnterStepMode(c));
    BAD(fmi3EnterEventMode(c));
    BAD(fmi3GetOutputDerivatives(c, &output, 1, &order, one, 1));
    values_3(c);
    states_3(c);
    OK(fmi3SetDebugLogging(c, true, 0, NULL));
    OK(step(c, 3, 0.1, 0.05));
    OK(fmi3Terminate(c));
    BAD(step(c, 3, 0.15, 0.1));
    OK(fmi3Reset(c));
    OK(enter(c, 3, 1));
    release(c, 3);
}

static void exchange_3(void) {
    void *c = make(3, 0, "exchange", GT_TOKEN, 0);
    bool flags[5], event, terminate;
    double next;
    size_t count;
    OK(fmi3GetNumberOfContinuousStates(c, &count));
    OK(fmi3GetNumberOfEventIndicators(c, &count));
    BAD(fmi3GetNumberOfEventIndicators(c, NULL));
    OK(enter(c, 3, 0));
    values_3(c);
    OK(fmi3EvaluateDiscreteStates(c));
    OK(leave(c, 3));
    BAD(fmi3UpdateDiscreteStates(c, flags, flags + 1, flags + 2, flags + 3, flags + 4, NULL));
    do OK(fmi3UpdateDiscreteStates(c, flags, flags + 1, flags + 2, flags + 3, flags + 4, &next));
    while (flags[0]);
    OK(fmi3EnterContinuousTimeMode(c));
    BAD(fmi3EvaluateDiscreteStates(c));
    OK(fmi3SetTime(c, 0.01));
    BAD(fmi3SetTime(c, (double)INFINITY));
    OK(fmi3GetContinuousStates(c, many, GT_STATES));
    OK(fmi3SetContinuousStates(c, many, GT_STATES));
    BAD(fmi3SetContinuousStates(c, many, GT_STATES + 1));
    OK(fmi3GetContinuousStateDerivatives(c, many, GT_STATES));
    OK(fmi3GetEventIndicators(c, many, GT_INDICATORS));
    OK(fmi3GetNominalsOfContinuousStates(c, many, GT_STATES));
    OK(fmi3CompletedIntegratorStep(c, true, &event, &terminate));
    values_3(c);
    states_3(c);
    BAD(step(c, 3, 0.01, 0.1));
    OK(fmi3EnterEventMode(c));
    OK(fmi3Reset(c));
    release(c, 3);
}

int main(void) {
    begin();
    unborn();
    cosimulation_2();
    exchange_2();
    cosimulation_3();
    exchange_3();
    return failures != 0;
}
