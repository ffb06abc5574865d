/* The functions of FMI 2.0.4. In which modes they are allowed: the tables of sections 3.2.3 and 4.2.4. */
#include "calls.h"

/* For the rest of a function `c` is the component; the call is refused unless kinds and modes allow it. */
#define GT_ENTER_2(kinds, modes)                                               \
    gt_component *c = gt_enter(component, __func__, 2, kinds, modes);          \
    if (!c) return fmi2Error

/* Messages are formats for printf: what is no format has its percent signs doubled. */
static void gt_sink_2(void *who, gt_status status, const char *category, const char *message) {
    const gt_component *c = who;
    char text[1024];
    size_t used = 0;
    if (!c->logger) return;
    for (; *message && used < sizeof text - 2; message++) {
        if (*message == '%') text[used++] = '%';
        text[used++] = *message;
    }
    text[used] = '\0';
    c->logger(c->environment, c->name, (fmi2Status)status, category, text);
}

GT_EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }

GT_EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

GT_EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String token, fmi2String resources,
                                        const fmi2CallbackFunctions *functions, fmi2Boolean visible,
                                        fmi2Boolean logging) {
    gt_component draft = { .version = 2 };
    (void)resources;
    (void)visible;
    draft.logger = functions ? functions->logger : NULL;
    draft.environment = functions ? functions->componentEnvironment : NULL;
    return gt_call_instantiate(&draft, gt_sink_2, __func__, name, token, type == fmi2CoSimulation, logging);
}

GT_EXPORT void fmi2FreeInstance(fmi2Component component) {
    gt_call_free(gt_enter(component, __func__, 2, GT_BOTH, GT_ALWAYS));
}

GT_EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component component, fmi2Boolean on, size_t count,
                                         const fmi2String categories[]) {
    GT_ENTER_2(GT_BOTH, GT_ALWAYS);
    return (fmi2Status)gt_call_logging(c, __func__, on, count, categories);
}

/* ---- Modes */

GT_EXPORT fmi2Status fmi2SetupExperiment(fmi2Component component, fmi2Boolean tolerance_defined, fmi2Real tolerance,
                                         fmi2Real start, fmi2Boolean stop_defined, fmi2Real stop) {
    GT_ENTER_2(GT_BOTH, GT_INSTANTIATED);
    return (fmi2Status)gt_call_setup(c, __func__, tolerance_defined, tolerance, start, stop_defined, stop);
}

GT_EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component component) {
    GT_ENTER_2(GT_BOTH, GT_INSTANTIATED);
    if (!c->it->now.ready)
        return (fmi2Status)GT_REFUSE(c, "%s: called before fmi2SetupExperiment, expected after it", __func__);
    c->it->mode = GT_INITIALIZATION;
    return fmi2OK;
}

GT_EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component component) {
    GT_ENTER_2(GT_BOTH, GT_INITIALIZATION);
    return (fmi2Status)gt_call_exit_initialization(c);
}

GT_EXPORT fmi2Status fmi2Terminate(fmi2Component component) {
    GT_ENTER_2(GT_BOTH, GT_EVENT | GT_CONTINUOUS | GT_STEP | GT_FAILED);
    c->it->mode = GT_TERMINATED;
    return fmi2OK;
}

GT_EXPORT fmi2Status fmi2Reset(fmi2Component component) {
    GT_ENTER_2(GT_BOTH, GT_ALWAYS);
    gt_call_reset(c);
    return fmi2OK;
}

/* ---- Values */

GT_EXPORT fmi2Status fmi2GetReal(fmi2Component component, const fmi2ValueReference references[], size_t count,
                                 fmi2Real values[]) {
    GT_ENTER_2(GT_BOTH, GT_READABLE);
    return (fmi2Status)gt_call_get(c, __func__, references, count, values, count);
}

GT_EXPORT fmi2Status fmi2SetReal(fmi2Component component, const fmi2ValueReference references[], size_t count,
                                 const fmi2Real values[]) {
    GT_ENTER_2(GT_BOTH, GT_SETTABLE);
    return (fmi2Status)gt_call_set(c, __func__, references, count, values, count);
}

GT_EXPORT fmi2Status fmi2GetInteger(fmi2Component component, const fmi2ValueReference references[], size_t count,
                                    fmi2Integer values[]) {
    GT_ENTER_2(GT_BOTH, GT_READABLE);
    return (fmi2Status)gt_call_get_integer(c, __func__, references, count, values, count);
}

#define GT_NONE_2(function, modes, constant, type, what)                                                      \
    GT_EXPORT fmi2Status function(fmi2Component component, const fmi2ValueReference references[], size_t count, \
                                  constant type values[]) {                                                   \
        GT_ENTER_2(GT_BOTH, modes);                                                                           \
        (void)values;                                                                                         \
        return (fmi2Status)gt_call_none(c, __func__, what, references, count);                                \
    }
#define GT_NOT_CONST
GT_NONE_2(fmi2SetInteger, GT_SETTABLE, const, fmi2Integer, "integer variable that may be set")
GT_NONE_2(fmi2GetBoolean, GT_READABLE, GT_NOT_CONST, fmi2Boolean, "Boolean variable")
GT_NONE_2(fmi2SetBoolean, GT_SETTABLE, const, fmi2Boolean, "Boolean variable")
GT_NONE_2(fmi2GetString, GT_READABLE, GT_NOT_CONST, fmi2String, "string variable")
GT_NONE_2(fmi2SetString, GT_SETTABLE, const, fmi2String, "string variable")

GT_EXPORT fmi2Status fmi2GetDirectionalDerivative(fmi2Component component, const fmi2ValueReference unknowns[],
                                                  size_t n, const fmi2ValueReference knowns[], size_t m,
                                                  const fmi2Real seed[], fmi2Real product[]) {
    GT_ENTER_2(GT_BOTH, GT_READABLE);
    return (fmi2Status)gt_call_derivative(c, __func__, 0, unknowns, n, knowns, m, seed, m, product, n);
}

/* ---- Saved states */

GT_EXPORT fmi2Status fmi2GetFMUstate(fmi2Component component, fmi2FMUstate *state) {
    GT_ENTER_2(GT_BOTH, GT_ALWAYS & ~GT_FAILED);
    return (fmi2Status)gt_call_save(c, __func__, state);
}

GT_EXPORT fmi2Status fmi2SetFMUstate(fmi2Component component, fmi2FMUstate state) {
    GT_ENTER_2(GT_BOTH, GT_ALWAYS);
    return (fmi2Status)gt_call_restore(c, __func__, state);
}

GT_EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component component, fmi2FMUstate *state) {
    GT_ENTER_2(GT_BOTH, GT_ALWAYS);
    return (fmi2Status)gt_call_forget(c, __func__, state);
}

GT_EXPORT fmi2Status fmi2SerializedFMUstateSize(fmi2Component component, fmi2FMUstate state, size_t *size) {
    GT_ENTER_2(GT_BOTH, GT_ALWAYS);
    return (fmi2Status)gt_call_state_size(c, __func__, state, size);
}

GT_EXPORT fmi2Status fmi2SerializeFMUstate(fmi2Component component, fmi2FMUstate state, fmi2Byte bytes[],
                                           size_t size) {
    GT_ENTER_2(GT_BOTH, GT_ALWAYS);
    return (fmi2Status)gt_call_serialize(c, __func__, state, bytes, size);
}

GT_EXPORT fmi2Status fmi2DeSerializeFMUstate(fmi2Component component, const fmi2Byte bytes[], size_t size,
                                             fmi2FMUstate *state) {
    GT_ENTER_2(GT_BOTH, GT_ALWAYS);
    return (fmi2Status)gt_call_deserialize(c, __func__, bytes, size, state);
}

/* ---- Model Exchange */

GT_EXPORT fmi2Status fmi2EnterEventMode(fmi2Component component) {
    GT_ENTER_2(GT_EXCHANGE, GT_EVENT | GT_CONTINUOUS);
    c->it->mode = GT_EVENT;
    return fmi2OK;
}

GT_EXPORT fmi2Status fmi2NewDiscreteStates(fmi2Component component, fmi2EventInfo *result) {
    gt_event_info info;
    gt_status status;
    GT_ENTER_2(GT_EXCHANGE, GT_EVENT);
    if (!gt_has(c, __func__, "the event information", result, 1)) return fmi2Error;
    status = gt_call_update(c, &info);
    result->newDiscreteStatesNeeded = info.again != 0;
    result->terminateSimulation = info.terminate != 0;
    result->nominalsOfContinuousStatesChanged = info.nominals_changed != 0;
    result->valuesOfContinuousStatesChanged = info.states_changed != 0;
    result->nextEventTimeDefined = info.next_defined != 0;
    result->nextEventTime = info.next;
    return (fmi2Status)status;
}

GT_EXPORT fmi2Status fmi2EnterContinuousTimeMode(fmi2Component component) {
    GT_ENTER_2(GT_EXCHANGE, GT_EVENT);
    return (fmi2Status)gt_call_continue(c, __func__);
}

GT_EXPORT fmi2Status fmi2CompletedIntegratorStep(fmi2Component component, fmi2Boolean final,
                                                 fmi2Boolean *event_mode, fmi2Boolean *terminate) {
    GT_ENTER_2(GT_EXCHANGE, GT_CONTINUOUS);
    (void)final;
    if (!gt_has(c, __func__, "a result", event_mode, 1) || !gt_has(c, __func__, "a result", terminate, 1))
        return fmi2Error;
    *terminate = 0;
    return (fmi2Status)gt_call_completed(c, event_mode);
}

GT_EXPORT fmi2Status fmi2SetTime(fmi2Component component, fmi2Real time) {
    GT_ENTER_2(GT_EXCHANGE, GT_EVENT | GT_CONTINUOUS);
    return gt_finite(c, __func__, "the time", time) ? (fmi2Status)gt_set_time(c->it, time) : fmi2Error;
}

GT_EXPORT fmi2Status fmi2SetContinuousStates(fmi2Component component, const fmi2Real x[], size_t count) {
    GT_ENTER_2(GT_EXCHANGE, GT_CONTINUOUS);
    return (fmi2Status)gt_call_set_states(c, __func__, x, count);
}

GT_EXPORT fmi2Status fmi2GetDerivatives(fmi2Component component, fmi2Real rates[], size_t count) {
    GT_ENTER_2(GT_EXCHANGE, GT_READABLE);
    if (!gt_vector(c, __func__, "derivatives", rates, count, GT_STATES)) return fmi2Error;
    return (fmi2Status)gt_get_rates(c->it, rates);
}

GT_EXPORT fmi2Status fmi2GetEventIndicators(fmi2Component component, fmi2Real indicators[], size_t count) {
    GT_ENTER_2(GT_EXCHANGE, GT_READABLE);
    if (!gt_vector(c, __func__, "event indicators", indicators, count, GT_INDICATORS)) return fmi2Error;
    return (fmi2Status)gt_get_indicators(c->it, indicators);
}

GT_EXPORT fmi2Status fmi2GetContinuousStates(fmi2Component component, fmi2Real x[], size_t count) {
    GT_ENTER_2(GT_EXCHANGE, GT_READABLE);
    if (!gt_vector(c, __func__, "states", x, count, GT_STATES)) return fmi2Error;
    return (fmi2Status)gt_get_states(c->it, x);
}

GT_EXPORT fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component component, fmi2Real nominals[], size_t count) {
    GT_ENTER_2(GT_EXCHANGE, GT_ALWAYS);
    if (!gt_vector(c, __func__, "nominal values", nominals, count, GT_STATES)) return fmi2Error;
    gt_get_nominals(c->it, nominals);
    return fmi2OK;
}

/* ---- Co-Simulation */

GT_EXPORT fmi2Status fmi2SetRealInputDerivatives(fmi2Component component, const fmi2ValueReference references[],
                                                 size_t count, const fmi2Integer orders[], const fmi2Real values[]) {
    GT_ENTER_2(GT_COSIMULATION, GT_INSTANTIATED | GT_INITIALIZATION | GT_STEP);
    (void)orders;
    (void)values;
    return (fmi2Status)gt_call_none(c, __func__, "input whose derivative may be set", references, count);
}

GT_EXPORT fmi2Status fmi2GetRealOutputDerivatives(fmi2Component component, const fmi2ValueReference references[],
                                                  size_t count, const fmi2Integer orders[], fmi2Real values[]) {
    GT_ENTER_2(GT_COSIMULATION, GT_STEP | GT_TERMINATED | GT_FAILED);
    (void)orders;
    (void)values;
    return (fmi2Status)gt_call_none(c, __func__, "output that has derivatives", references, count);
}

GT_EXPORT fmi2Status fmi2DoStep(fmi2Component component, fmi2Real point, fmi2Real size, fmi2Boolean final) {
    double reached;
    gt_status status;
    GT_ENTER_2(GT_COSIMULATION, GT_STEP);
    (void)final;
    status = gt_call_step(c, __func__, point, size, &reached);
    if (status == GT_OK && c->it->now.ended) status = c->stepped = GT_DISCARD; /* section 4.2.2: fmi2Terminated tells why */
    return (fmi2Status)status;
}

GT_EXPORT fmi2Status fmi2CancelStep(fmi2Component component) {
    GT_ENTER_2(GT_COSIMULATION, GT_ALWAYS);
    return (fmi2Status)GT_REFUSE(c, "%s: steps never run in the background, expected no call", __func__);
}

/* Of the status of a step only what a finished one has can be asked. */
#define GT_STATUS_2(function, type, kind, answer)                                                             \
    GT_EXPORT fmi2Status function(fmi2Component component, const fmi2StatusKind what, type *value) {          \
        GT_ENTER_2(GT_COSIMULATION, GT_STEP | GT_TERMINATED | GT_FAILED);                                     \
        if (!gt_has(c, __func__, "the result", value, 1)) return fmi2Error;                                   \
        if ((int)what != (int)(kind))                                                                         \
            return (fmi2Status)GT_REFUSE(c, "%s: status kind %d is not answered by this function", __func__,  \
                                         (int)what);                                                          \
        *value = answer;                                                                                      \
        return fmi2OK;                                                                                        \
    }
GT_STATUS_2(fmi2GetStatus, fmi2Status, fmi2DoStepStatus, (fmi2Status)c->stepped)
GT_STATUS_2(fmi2GetRealStatus, fmi2Real, fmi2LastSuccessfulTime, c->it->time)
GT_STATUS_2(fmi2GetIntegerStatus, fmi2Integer, -1, 0)
GT_STATUS_2(fmi2GetBooleanStatus, fmi2Boolean, fmi2Terminated, c->it->now.ended != 0)
GT_STATUS_2(fmi2GetStringStatus, fmi2String, fmi2PendingStatus, "no step is running in the background")
