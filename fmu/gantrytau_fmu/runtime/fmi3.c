/* The functions of FMI 3.0.2. In which modes they are allowed: sections 2.3, 3.2 and 4.2. */
#include "calls.h"

/* For the rest of a function `c` is the component; the call is refused unless kinds and modes allow it. */
#define GT_ENTER_3(kinds, modes)                                               \
    gt_component *c = gt_enter(instance, __func__, 3, kinds, modes);           \
    if (!c) return fmi3Error

static void gt_sink_3(void *who, gt_status status, const char *category, const char *message) {
    const gt_component *c = who;
    if (c->log_message) c->log_message(c->environment, (fmi3Status)status, category, message);
}

GT_EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

GT_EXPORT fmi3Instance fmi3InstantiateModelExchange(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log_message) {
    gt_component draft = { .version = 3 };
    (void)resources;
    (void)visible;
    draft.environment = environment;
    draft.log_message = log_message;
    return gt_call_instantiate(&draft, gt_sink_3, __func__, name, token, 0, logging);
}

/* Early returns and intermediate updates are never made use of, so being allowed to changes nothing. */
GT_EXPORT fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3Boolean event_mode_used, fmi3Boolean early_return_allowed, const fmi3ValueReference intermediate[],
    size_t intermediate_count, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log_message,
    fmi3IntermediateUpdateCallback update) {
    gt_component draft = { .version = 3 };
    (void)resources;
    (void)visible;
    (void)early_return_allowed;
    (void)intermediate;
    (void)intermediate_count;
    (void)update;
    draft.environment = environment;
    draft.log_message = log_message;
    if (event_mode_used)
        return gt_refuse_instance(&draft, gt_sink_3, __func__,
                                  "eventModeUsed is true, expected false: there is no event mode in Co-Simulation");
    return gt_call_instantiate(&draft, gt_sink_3, __func__, name, token, 1, logging);
}

GT_EXPORT fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log_message, fmi3ClockUpdateCallback update,
    fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock) {
    gt_component draft = { .version = 3 };
    (void)name;
    (void)token;
    (void)resources;
    (void)visible;
    (void)logging;
    (void)update;
    (void)lock;
    (void)unlock;
    draft.environment = environment;
    draft.log_message = log_message;
    return gt_refuse_instance(&draft, gt_sink_3, __func__, "this FMU has no Scheduled Execution");
}

GT_EXPORT void fmi3FreeInstance(fmi3Instance instance) {
    gt_call_free(gt_enter(instance, __func__, 3, GT_BOTH, GT_ALWAYS));
}

GT_EXPORT fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean on, size_t count,
                                         const fmi3String categories[]) {
    GT_ENTER_3(GT_BOTH, GT_ALWAYS);
    return (fmi3Status)gt_call_logging(c, __func__, on, count, categories);
}

/* ---- Modes */

GT_EXPORT fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean tolerance_defined,
                                                 fmi3Float64 tolerance, fmi3Float64 start, fmi3Boolean stop_defined,
                                                 fmi3Float64 stop) {
    gt_status status;
    GT_ENTER_3(GT_BOTH, GT_INSTANTIATED);
    status = gt_call_setup(c, __func__, tolerance_defined, tolerance, start, stop_defined, stop);
    if (status < GT_DISCARD) c->it->mode = GT_INITIALIZATION;
    return (fmi3Status)status;
}

GT_EXPORT fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) {
    GT_ENTER_3(GT_BOTH, GT_INITIALIZATION);
    return (fmi3Status)gt_call_exit_initialization(c);
}

GT_EXPORT fmi3Status fmi3Terminate(fmi3Instance instance) {
    GT_ENTER_3(GT_BOTH, GT_EVENT | GT_CONTINUOUS | GT_STEP | GT_FAILED);
    c->it->mode = GT_TERMINATED;
    return fmi3OK;
}

GT_EXPORT fmi3Status fmi3Reset(fmi3Instance instance) {
    GT_ENTER_3(GT_BOTH, GT_ALWAYS);
    gt_call_reset(c);
    return fmi3OK;
}

GT_EXPORT fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance) {
    GT_ENTER_3(GT_BOTH, GT_ALWAYS);
    return (fmi3Status)GT_REFUSE(c, "%s: this FMU has no structural parameters", __func__);
}

GT_EXPORT fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance) {
    GT_ENTER_3(GT_BOTH, GT_ALWAYS);
    return (fmi3Status)GT_REFUSE(c, "%s: called in %s, expected configuration mode, which this FMU does not have",
                                 __func__, gt_mode_name(c->it->mode));
}

/* ---- Values */

GT_EXPORT fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
                                    fmi3Float64 values[], size_t value_count) {
    GT_ENTER_3(GT_BOTH, GT_READABLE);
    return (fmi3Status)gt_call_get(c, __func__, references, count, values, value_count);
}

GT_EXPORT fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
                                    const fmi3Float64 values[], size_t value_count) {
    GT_ENTER_3(GT_BOTH, GT_SETTABLE);
    return (fmi3Status)gt_call_set(c, __func__, references, count, values, value_count);
}

GT_EXPORT fmi3Status fmi3GetInt32(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
                                  fmi3Int32 values[], size_t value_count) {
    GT_ENTER_3(GT_BOTH, GT_READABLE);
    return (fmi3Status)gt_call_get_integer(c, __func__, references, count, values, value_count);
}

/* A function for variables of which this FMU has none; the rest of its arguments follow, and GT_UNUSED_3 names them. */
#define GT_NONE_3(function, kinds, modes, what, ...)                                                             \
    GT_EXPORT fmi3Status function(fmi3Instance instance, const fmi3ValueReference references[], size_t count,    \
                                  __VA_ARGS__) {                                                                 \
        GT_ENTER_3(kinds, modes);                                                                                \
        GT_UNUSED_3;                                                                                             \
        return (fmi3Status)gt_call_none(c, __func__, what, references, count);                                   \
    }

#define GT_UNUSED_3 (void)values, (void)value_count
#define GT_TYPE_3(name)                                                                                          \
    GT_NONE_3(fmi3Get##name, GT_BOTH, GT_READABLE, #name " variable", fmi3##name values[], size_t value_count)   \
    GT_NONE_3(fmi3Set##name, GT_BOTH, GT_SETTABLE, #name " variable", const fmi3##name values[],                 \
              size_t value_count)
GT_TYPE_3(Float32)
GT_TYPE_3(Int8)
GT_TYPE_3(UInt8)
GT_TYPE_3(Int16)
GT_TYPE_3(UInt16)
GT_TYPE_3(UInt32)
GT_TYPE_3(Int64)
GT_TYPE_3(UInt64)
GT_TYPE_3(Boolean)
GT_TYPE_3(String)
GT_NONE_3(fmi3SetInt32, GT_BOTH, GT_SETTABLE, "Int32 variable that may be set", const fmi3Int32 values[],
          size_t value_count)
#undef GT_UNUSED_3
#define GT_UNUSED_3 (void)sizes, (void)values, (void)value_count
GT_NONE_3(fmi3GetBinary, GT_BOTH, GT_READABLE, "Binary variable", size_t sizes[], fmi3Binary values[],
          size_t value_count)
GT_NONE_3(fmi3SetBinary, GT_BOTH, GT_SETTABLE, "Binary variable", const size_t sizes[], const fmi3Binary values[],
          size_t value_count)

/* Clocks, and derivatives of outputs. */
#undef GT_UNUSED_3
#define GT_UNUSED_3 (void)values
GT_NONE_3(fmi3GetClock, GT_BOTH, GT_ALWAYS, "Clock", fmi3Clock values[])
GT_NONE_3(fmi3SetClock, GT_BOTH, GT_ALWAYS, "Clock", const fmi3Clock values[])
GT_NONE_3(fmi3GetShiftDecimal, GT_BOTH, GT_ALWAYS, "Clock", fmi3Float64 values[])
GT_NONE_3(fmi3SetShiftDecimal, GT_BOTH, GT_ALWAYS, "Clock", const fmi3Float64 values[])
GT_NONE_3(fmi3SetIntervalDecimal, GT_BOTH, GT_ALWAYS, "Clock", const fmi3Float64 values[])
#undef GT_UNUSED_3
#define GT_UNUSED_3 (void)values, (void)others
GT_NONE_3(fmi3GetIntervalDecimal, GT_BOTH, GT_ALWAYS, "Clock", fmi3Float64 values[], fmi3IntervalQualifier others[])
GT_NONE_3(fmi3SetIntervalFraction, GT_BOTH, GT_ALWAYS, "Clock", const fmi3UInt64 values[], const fmi3UInt64 others[])
GT_NONE_3(fmi3GetShiftFraction, GT_BOTH, GT_ALWAYS, "Clock", fmi3UInt64 values[], fmi3UInt64 others[])
GT_NONE_3(fmi3SetShiftFraction, GT_BOTH, GT_ALWAYS, "Clock", const fmi3UInt64 values[], const fmi3UInt64 others[])
#undef GT_UNUSED_3
#define GT_UNUSED_3 (void)values, (void)others, (void)more
GT_NONE_3(fmi3GetIntervalFraction, GT_BOTH, GT_ALWAYS, "Clock", fmi3UInt64 values[], fmi3UInt64 others[],
          fmi3IntervalQualifier more[])
GT_NONE_3(fmi3GetOutputDerivatives, GT_COSIMULATION, GT_STEP | GT_TERMINATED | GT_FAILED,
          "output that has derivatives", const fmi3Int32 others[], fmi3Float64 values[], size_t more)

/* ---- Derivatives, dependencies */

GT_EXPORT fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t n,
                                                  const fmi3ValueReference knowns[], size_t m, const fmi3Float64 seed[],
                                                  size_t seeds, fmi3Float64 product[], size_t products) {
    GT_ENTER_3(GT_BOTH, GT_READABLE);
    return (fmi3Status)gt_call_derivative(c, __func__, 0, unknowns, n, knowns, m, seed, seeds, product, products);
}

GT_EXPORT fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t n,
                                              const fmi3ValueReference knowns[], size_t m, const fmi3Float64 seed[],
                                              size_t seeds, fmi3Float64 product[], size_t products) {
    GT_ENTER_3(GT_BOTH, GT_READABLE);
    return (fmi3Status)gt_call_derivative(c, __func__, 1, unknowns, n, knowns, m, seed, seeds, product, products);
}

GT_EXPORT fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance, fmi3ValueReference reference,
                                                         size_t *count) {
    GT_ENTER_3(GT_BOTH, GT_ALWAYS);
    (void)count;
    if (!gt_known(c, __func__, &reference, 1)) return fmi3Error;
    return (fmi3Status)GT_REFUSE(c, "%s: not supported; the dependencies of %s are in the model description", __func__,
                                 gt_name(reference));
}

GT_EXPORT fmi3Status fmi3GetVariableDependencies(
    fmi3Instance instance, fmi3ValueReference dependent, size_t elements[], fmi3ValueReference independents[],
    size_t independent_elements[], fmi3DependencyKind kinds[], size_t count) {
    GT_ENTER_3(GT_BOTH, GT_ALWAYS);
    (void)elements;
    (void)independents;
    (void)independent_elements;
    (void)kinds;
    (void)count;
    if (!gt_known(c, __func__, &dependent, 1)) return fmi3Error;
    return (fmi3Status)GT_REFUSE(c, "%s: not supported; the dependencies of %s are in the model description", __func__,
                                 gt_name(dependent));
}

/* ---- Saved states */

GT_EXPORT fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *state) {
    GT_ENTER_3(GT_BOTH, GT_ALWAYS & ~GT_FAILED);
    return (fmi3Status)gt_call_save(c, __func__, state);
}

GT_EXPORT fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState state) {
    GT_ENTER_3(GT_BOTH, GT_ALWAYS);
    return (fmi3Status)gt_call_restore(c, __func__, state);
}

GT_EXPORT fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *state) {
    GT_ENTER_3(GT_BOTH, GT_ALWAYS);
    return (fmi3Status)gt_call_forget(c, __func__, state);
}

GT_EXPORT fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState state, size_t *size) {
    GT_ENTER_3(GT_BOTH, GT_ALWAYS);
    return (fmi3Status)gt_call_state_size(c, __func__, state, size);
}

GT_EXPORT fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
    GT_ENTER_3(GT_BOTH, GT_ALWAYS);
    return (fmi3Status)gt_call_serialize(c, __func__, state, bytes, size);
}

GT_EXPORT fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte bytes[], size_t size,
                                             fmi3FMUState *state) {
    GT_ENTER_3(GT_BOTH, GT_ALWAYS);
    return (fmi3Status)gt_call_deserialize(c, __func__, bytes, size, state);
}

/* ---- Events */

GT_EXPORT fmi3Status fmi3EnterEventMode(fmi3Instance instance) {
    GT_ENTER_3(GT_EXCHANGE, GT_EVENT | GT_CONTINUOUS);
    c->it->mode = GT_EVENT;
    return fmi3OK;
}

/* What depends on discrete states is evaluated whenever it is read. */
GT_EXPORT fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance) {
    GT_ENTER_3(GT_EXCHANGE, GT_INITIALIZATION | GT_EVENT);
    return fmi3OK;
}

GT_EXPORT fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *again, fmi3Boolean *terminate,
                                              fmi3Boolean *nominals_changed, fmi3Boolean *states_changed,
                                              fmi3Boolean *next_defined, fmi3Float64 *next) {
    gt_event_info info;
    gt_status status;
    GT_ENTER_3(GT_EXCHANGE, GT_EVENT);
    if (!gt_has(c, __func__, "a result", again && terminate && nominals_changed && states_changed && next_defined
                                             ? next : NULL, 1))
        return fmi3Error;
    status = gt_call_update(c, &info);
    *again = info.again != 0;
    *terminate = info.terminate != 0;
    *nominals_changed = info.nominals_changed != 0;
    *states_changed = info.states_changed != 0;
    *next_defined = info.next_defined != 0;
    *next = info.next;
    return (fmi3Status)status;
}

/* ---- Model Exchange */

GT_EXPORT fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance) {
    GT_ENTER_3(GT_EXCHANGE, GT_EVENT);
    return (fmi3Status)gt_call_continue(c, __func__);
}

GT_EXPORT fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean final, fmi3Boolean *event_mode,
                                                 fmi3Boolean *terminate) {
    int turned = 0;
    fmi3Status status;
    GT_ENTER_3(GT_EXCHANGE, GT_CONTINUOUS);
    (void)final;
    if (!gt_has(c, __func__, "a result", event_mode, 1) || !gt_has(c, __func__, "a result", terminate, 1))
        return fmi3Error;
    status = (fmi3Status)gt_call_completed(c, &turned);
    *event_mode = turned != 0;
    *terminate = false;
    return status;
}

GT_EXPORT fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time) {
    GT_ENTER_3(GT_EXCHANGE, GT_EVENT | GT_CONTINUOUS);
    return gt_finite(c, __func__, "the time", time) ? (fmi3Status)gt_set_time(c->it, time) : fmi3Error;
}

GT_EXPORT fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 x[], size_t count) {
    GT_ENTER_3(GT_EXCHANGE, GT_CONTINUOUS);
    return (fmi3Status)gt_call_set_states(c, __func__, x, count);
}

GT_EXPORT fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 rates[], size_t count) {
    GT_ENTER_3(GT_EXCHANGE, GT_READABLE);
    if (!gt_vector(c, __func__, "derivatives", rates, count, GT_STATES)) return fmi3Error;
    return (fmi3Status)gt_get_rates(c->it, rates);
}

GT_EXPORT fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64 indicators[], size_t count) {
    GT_ENTER_3(GT_EXCHANGE, GT_READABLE);
    if (!gt_vector(c, __func__, "event indicators", indicators, count, GT_INDICATORS)) return fmi3Error;
    return (fmi3Status)gt_get_indicators(c->it, indicators);
}

GT_EXPORT fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 x[], size_t count) {
    GT_ENTER_3(GT_EXCHANGE, GT_READABLE);
    if (!gt_vector(c, __func__, "states", x, count, GT_STATES)) return fmi3Error;
    return (fmi3Status)gt_get_states(c->it, x);
}

GT_EXPORT fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 nominals[], size_t count) {
    GT_ENTER_3(GT_EXCHANGE, GT_ALWAYS);
    if (!gt_vector(c, __func__, "nominal values", nominals, count, GT_STATES)) return fmi3Error;
    gt_get_nominals(c->it, nominals);
    return fmi3OK;
}

#define GT_NUMBER_3(function, number)                                                                            \
    GT_EXPORT fmi3Status function(fmi3Instance instance, size_t *count) {                                        \
        GT_ENTER_3(GT_EXCHANGE, GT_ALWAYS);                                                                      \
        if (!gt_has(c, __func__, "the result", count, 1)) return fmi3Error;                                      \
        *count = number;                                                                                         \
        return fmi3OK;                                                                                           \
    }
GT_NUMBER_3(fmi3GetNumberOfEventIndicators, GT_INDICATORS)
GT_NUMBER_3(fmi3GetNumberOfContinuousStates, GT_STATES)

/* ---- Co-Simulation */

GT_EXPORT fmi3Status fmi3EnterStepMode(fmi3Instance instance) {
    GT_ENTER_3(GT_COSIMULATION, GT_ALWAYS);
    return (fmi3Status)GT_REFUSE(c, "%s: called in %s, expected event mode, which this FMU does not have in "
                                 "Co-Simulation", __func__, gt_mode_name(c->it->mode));
}

GT_EXPORT fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 point, fmi3Float64 size, fmi3Boolean final,
                                fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *reached) {
    gt_status status;
    GT_ENTER_3(GT_COSIMULATION, GT_STEP);
    (void)final;
    if (!gt_has(c, __func__, "a result", event && terminate && early ? reached : NULL, 1)) return fmi3Error;
    *event = *terminate = *early = false;
    status = gt_call_step(c, __func__, point, size, reached);
    *terminate = status == GT_OK && c->it->now.ended; /* at `reached`, before the end of the step */
    return (fmi3Status)status;
}

GT_EXPORT fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference clock, fmi3Float64 time) {
    GT_ENTER_3(GT_BOTH, GT_ALWAYS);
    (void)clock;
    (void)time;
    return (fmi3Status)GT_REFUSE(c, "%s: this FMU has no Scheduled Execution", __func__);
}
