/* Random calls, right and wrong: fuzz SEED CALLS. Ends with a message and code 1 where the FMU misbehaves:
 * a failure without a line that names function or variable, a refused call that changes something, a number that
 * is not finite with status OK, a state that is not finite, a call that takes two seconds. Sanitizers see the rest. */
#include "driver.h"

#include <float.h>
#include <time.h>

#if defined __SANITIZE_ADDRESS__
#define LONGEST 20. /* s of processor time, for one call */
#else
#define LONGEST 2.
#endif

typedef struct {
    void *c; /* component, or NULL */
    int version, cosimulation, corrupt;
    void *saved;
} slot;

static slot slots[4];
static uint64_t state, number;
static gt_state before;
static gt_mode mode_before;
static double began;

/* ---- Chance: Steele, Lea and Flood's splitmix64 */

static uint64_t draw(void) {
    uint64_t z = (state += UINT64_C(0x9e3779b97f4a7c15));
    z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
    return z ^ (z >> 31);
}
static unsigned below(unsigned n) { return (unsigned)(draw() % n); }
static int chance(unsigned percent) { return below(100) < percent; }
static double uniform(double from, double to) { return from + (to - from) * (double)(draw() >> 11) * 0x1p-53; }

static double strange(void) {
    static const double values[] = {0, -0., 1, -1, 5e-324, -1e-310, 1e-300, DBL_EPSILON, 1e-8, 1e8, -1e15, 1e100, 1e300, -1e300, DBL_MAX};
    switch (below(6)) {
    case 0: return (double)NAN;
    case 1: return chance(50) ? (double)INFINITY : -(double)INFINITY;
    default: return values[below(sizeof values / sizeof *values)];
    }
}
static double any(void) { return chance(75) ? uniform(-2, 2) : strange(); }

/* Mostly a variable that exists. */
static unsigned reference(void) {
    if (chance(4)) return chance(50) ? GT_VARIABLES + below(3) : 0xffffffffu - below(3);
    if (chance(60)) { /* of one kind, so that rare kinds are met */
        const gt_kind kind = (gt_kind)below(GT_INDICATOR + 1);
        unsigned i, tries;
        for (tries = 0; tries < 50; tries++)
            if (gt_variables[i = below(GT_VARIABLES)].kind == kind) return i;
    }
    return below(GT_VARIABLES);
}

/* ---- What must hold after every call */

static void stop(const char *function, const char *why) {
    fprintf(stderr, "call %llu, %s: %s\n  the last line was: %s\n", (unsigned long long)number, function, why, said);
    exit(1);
}

static gt_instance *core(const slot *s) { return s->c ? ((gt_component *)s->c)->it : NULL; }

static double seconds(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void listen(const slot *s) {
    number++;
    lines = 0;
    if (s->c) {
        before = core(s)->now;
        mode_before = core(s)->mode;
    }
    began = seconds();
}

static int same(const void *a, const void *b, size_t size) { return !memcmp(a, b, size); }

static void check_finite(const char *function, const double *values, size_t count, const char *why) {
    size_t i;
    for (i = 0; i < count; i++)
        if (!isfinite(values[i])) stop(function, why);
}

/* The instance after a call; quiet: a failure without a line is fine. Returns the status. */
static int judge(const slot *s, const char *function, int status) {
    const gt_state *now = s->c ? &core(s)->now : NULL;
    /* between steps modes of switches follow from what is set, as the unknowns z do, wherever they are asked for */
    const size_t held = s->c && core(s)->mode & (GT_EVENT | GT_CONTINUOUS) ? GT_MODES : GT_FRICTIONS;
    if (seconds() - began > LONGEST) stop(function, "takes too long");
    if (status < 0 || status > GT_FATAL) stop(function, "returns no status");
    if (status >= GT_DISCARD && !lines) stop(function, "fails without a line");
    if (status >= GT_DISCARD && !names_something(said)) stop(function, "tells of no function or variable");
    if (!s->c) return status;
    if (status >= GT_DISCARD && core(s)->mode != GT_FAILED &&
        !(core(s)->mode == mode_before && now->time == before.time && same(now->u, before.u, sizeof now->u) &&
          same(now->p, before.p, sizeof now->p) && same(now->m, before.m, held * sizeof(double)) &&
          same(now->ticks, before.ticks, sizeof now->ticks) &&
          (core(s)->mode == GT_INITIALIZATION || same(now->x, before.x, sizeof now->x))))
        stop(function, "is refused, but changes something");
    if (core(s)->mode == GT_FAILED) return status;
    check_finite(function, &now->time, 1, "leaves a time that is not finite");
    check_finite(function, now->x, GT_STATES, "leaves states that are not finite");
    check_finite(function, now->u, GT_KNOWN, "leaves inputs that are not finite");
    check_finite(function, now->p, GT_PARAMETERS, "leaves parameters that are not finite");
    return status;
}

/* CALL(DoStep, ...) with the instance put first; BOTH(...) where both versions take the same arguments. */
#define CALL(name, ...) (listen(s), judge(s, #name, (int)name(s->c, __VA_ARGS__)))
#define BARE(name) (listen(s), judge(s, #name, (int)name(s->c)))
#define PLAIN(name) (s->version == 2 ? BARE(fmi2##name) : BARE(fmi3##name))
#define BOTH(name2, name3, ...) (s->version == 2 ? CALL(fmi2##name2, __VA_ARGS__) : CALL(fmi3##name3, __VA_ARGS__))

/* ---- Values; every array has exactly the size that is told, so that what goes beyond is seen */

static double *numbers(size_t count) {
    double *found = malloc(count * sizeof *found);
    size_t i;
    for (i = 0; i < count; i++) found[i] = any();
    return found;
}

static unsigned *references(size_t count) {
    unsigned *found = malloc(count * sizeof *found);
    size_t i;
    for (i = 0; i < count; i++) found[i] = reference();
    return found;
}

static size_t nearly(size_t count) { return chance(92) ? count : count + below(3) - (count > 0); }

static void values(slot *s, int setting) {
    const size_t count = chance(20) ? below(6) : 1, told = nearly(count);
    unsigned *which = references(count), *given = chance(3) ? NULL : which;
    double *room = numbers(told > count ? told : count), *to = chance(3) ? NULL : room;
    int status;
    if (setting)
        status = s->version == 2 ? CALL(fmi2SetReal, given, count, to) : CALL(fmi3SetFloat64, given, count, to, told);
    else
        status = s->version == 2 ? CALL(fmi2GetReal, given, count, to) : CALL(fmi3GetFloat64, given, count, to, told);
    if (!setting && status < GT_DISCARD) check_finite("get", room, count, "gives what is not finite");
    free(which);
    free(room);
}

static void sensitivities(slot *s) {
    const size_t n = below(4), m = below(4), seeds = nearly(m), products = nearly(n);
    unsigned *unknown = references(n), *known = references(m);
    double *seed = numbers(seeds > m ? seeds : m), *product = numbers(products > n ? products : n);
    int status;
    if (s->version == 2) status = CALL(fmi2GetDirectionalDerivative, unknown, n, known, m, chance(3) ? NULL : seed, product);
    else if (chance(50)) status = CALL(fmi3GetDirectionalDerivative, unknown, n, known, m, seed, seeds, product, products);
    else status = CALL(fmi3GetAdjointDerivative, known, m, unknown, n, seed, seeds, chance(3) ? NULL : product, products);
    if (status < GT_DISCARD && n) check_finite("derivative", product, n, "gives what is not finite");
    free(unknown);
    free(known);
    free(seed);
    free(product);
}

static void vectors(slot *s) {
    static const size_t sizes[] = {GT_STATES, GT_STATES, GT_INDICATORS, GT_STATES, GT_STATES};
    const unsigned which = below(5);
    const size_t count = nearly(sizes[which]);
    double *room = numbers(count), *to = chance(3) ? NULL : room;
    int status;
    switch (which) {
    case 0: status = BOTH(SetContinuousStates, SetContinuousStates, to, count); break;
    case 1: status = BOTH(GetDerivatives, GetContinuousStateDerivatives, to, count); break;
    case 2: status = BOTH(GetEventIndicators, GetEventIndicators, to, count); break;
    case 3: status = BOTH(GetContinuousStates, GetContinuousStates, to, count); break;
    default: status = BOTH(GetNominalsOfContinuousStates, GetNominalsOfContinuousStates, to, count);
    }
    if (which && status < GT_DISCARD) check_finite("vector", room, count, "gives what is not finite");
    free(room);
}

/* ---- Time */

static int steps(slot *s, double point, double size) {
    bool event, terminate, early;
    double reached = 0;
    if (s->version == 2) return CALL(fmi2DoStep, point, size, 1);
    return CALL(fmi3DoStep, point, size, true, &event, &terminate, &early, chance(2) ? NULL : &reached);
}

static void stepping(slot *s) {
    const double time = core(s)->time;
    if (chance(90)) steps(s, time, chance(90) ? uniform(1e-4, 0.1) : uniform(0, 3));
    else if (chance(50)) steps(s, time, strange());
    else steps(s, any(), any());
}

static void updating(slot *s) {
    if (s->version == 2) {
        fmi2EventInfo info;
        CALL(fmi2NewDiscreteStates, chance(2) ? NULL : &info);
    } else {
        bool flags[5];
        double next;
        CALL(fmi3UpdateDiscreteStates, flags, flags + 1, flags + 2, flags + 3, flags + 4, chance(2) ? NULL : &next);
    }
}

static void completed(slot *s) {
    if (s->version == 2) {
        int event, terminate;
        CALL(fmi2CompletedIntegratorStep, 1, &event, chance(2) ? NULL : &terminate);
    } else {
        bool event, terminate;
        CALL(fmi3CompletedIntegratorStep, true, &event, chance(2) ? NULL : &terminate);
    }
}

/* A step as an importer takes it. */
static void euler(slot *s) {
    double x[GT_ROOM(GT_STATES)], rates[GT_ROOM(GT_STATES)];
    const double h = chance(90) ? uniform(0, 0.02) : uniform(-0.1, 1);
    int i;
    if (BOTH(GetContinuousStates, GetContinuousStates, x, GT_STATES)) return;
    if (BOTH(GetDerivatives, GetContinuousStateDerivatives, rates, GT_STATES)) return;
    for (i = 0; i < GT_STATES; i++) x[i] += h * rates[i];
    if (BOTH(SetTime, SetTime, core(s)->time + h)) return;
    if (BOTH(SetContinuousStates, SetContinuousStates, x, GT_STATES)) return;
    completed(s);
    if (chance(30)) PLAIN(EnterEventMode);
}

static void experiment(slot *s) {
    const double start = chance(90) ? 0 : any(), stop = chance(80) ? uniform(1, 20) : any();
    const double tolerance = chance(70) ? 1e-4 : any();
    if (s->version == 3) CALL(fmi3EnterInitializationMode, chance(30), tolerance, start, chance(20), stop);
    else {
        CALL(fmi2SetupExperiment, (int)chance(30), tolerance, start, (int)chance(20), stop);
        BARE(fmi2EnterInitializationMode);
    }
}

/* The call that leads on. */
static void onward(slot *s) {
    switch (core(s)->mode) {
    case GT_INSTANTIATED: experiment(s); break;
    case GT_INITIALIZATION: PLAIN(ExitInitializationMode); break;
    case GT_STEP: stepping(s); break;
    case GT_EVENT:
        updating(s);
        if (core(s)->mode == GT_EVENT && !core(s)->now.unsettled) PLAIN(EnterContinuousTimeMode);
        break;
    case GT_CONTINUOUS: euler(s); break;
    default: PLAIN(Reset);
    }
}

/* ---- Saved states */

static void keep(slot *s) {
    if (BOTH(GetFMUstate, GetFMUState, chance(2) ? NULL : &s->saved) < GT_DISCARD && s->saved && lines == 0) s->corrupt = 0;
}

static void back(slot *s) {
    const slot *other = slots + below(4);
    const int status = BOTH(SetFMUstate, SetFMUState, other->saved);
    if (other->saved && other->corrupt && status < GT_DISCARD) stop("SetFMUState", "takes a damaged state");
    if (other->saved && !other->corrupt && other->cosimulation == s->cosimulation && other->version == s->version && status)
        stop("SetFMUState", "refuses a good state");
}

static void forget(slot *s) {
    BOTH(FreeFMUstate, FreeFMUState, chance(2) ? NULL : &s->saved);
}

static void by_bytes(slot *s) {
    size_t size = 0, told;
    char *bytes;
    if (BOTH(SerializedFMUstateSize, SerializedFMUStateSize, s->saved, &size) || !s->saved) return;
    told = chance(90) ? size : size + below(17) - 8;
    bytes = calloc(told > size ? told : size, 1);
    if (s->version == 2 ? CALL(fmi2SerializeFMUstate, s->saved, bytes, told)
                        : CALL(fmi3SerializeFMUState, s->saved, (fmi3Byte *)bytes, told)) told = size;
    else if (told != size) stop("Serialize", "takes a wrong size");
    else {
        const int damage = chance(50) && !s->corrupt; /* the same bit twice would be no damage */
        if (damage) bytes[chance(20) ? below(40) : below((unsigned)size)] ^= (char)(1 << below(8));
        if ((s->version == 2 ? CALL(fmi2DeSerializeFMUstate, bytes, size, &s->saved)
                             : CALL(fmi3DeserializeFMUState, (fmi3Byte *)bytes, size, &s->saved)) < GT_DISCARD)
            s->corrupt |= damage;
    }
    free(bytes);
}

/* ---- Whatever else there is */

#define TYPES(do)                                                                                               \
    do(0, Float32) do(1, Int8) do(2, UInt8) do(3, Int16) do(4, UInt16) do(5, Int32) do(6, UInt32) do(7, Int64)  \
    do(8, UInt64) do(9, Boolean) do(10, String)
#define ONE_TYPE(place, type)                                                                                   \
    case place:                                                                                                 \
        if (chance(50)) CALL(fmi3Get##type, which, count, (fmi3##type *)room, told);                            \
        else CALL(fmi3Set##type, which, count, (fmi3##type *)room, told);                                       \
        break;

static void other_types(slot *s) {
    const size_t count = below(3), told = nearly(count);
    unsigned *which = references(count);
    void *room = calloc(told + count + 1, 16);
    if (s->version == 2) switch (below(6)) {
        case 0: CALL(fmi2GetInteger, which, count, room); break;
        case 1: CALL(fmi2SetInteger, which, count, room); break;
        case 2: CALL(fmi2GetBoolean, which, count, room); break;
        case 3: CALL(fmi2SetBoolean, which, count, room); break;
        case 4: CALL(fmi2GetString, which, count, room); break;
        default: CALL(fmi2SetString, which, count, room);
    }
    else switch (below(14)) {
        TYPES(ONE_TYPE)
        case 11: CALL(fmi3GetBinary, which, count, room, room, told); break;
        case 12: CALL(fmi3GetClock, which, count, room); break;
        default: CALL(fmi3GetIntervalDecimal, which, count, room, room);
    }
    free(which);
    free(room);
}

static void logging(slot *s) {
    static const char *const names[] = {"logEvents", "logCalls", "logStatusWarning", "nonsense", NULL};
    const char *some[2] = {names[below(5)], names[below(5)]};
    BOTH(SetDebugLogging, SetDebugLogging, chance(50), below(3), chance(5) ? NULL : some);
}

static void out_of_order(slot *s) {
    double last;
    switch (below(11)) {
    case 0: PLAIN(EnterEventMode); break;
    case 1: PLAIN(EnterContinuousTimeMode); break;
    case 2: PLAIN(Terminate); break;
    case 3: PLAIN(ExitInitializationMode); break;
    case 4: PLAIN(Reset); break;
    case 5: BOTH(SetTime, SetTime, any()); break;
    case 6: experiment(s); break;
    case 7: stepping(s); break;
    case 8: updating(s); break;
    case 9: completed(s); break;
    default:
        if (s->version == 2) CALL(fmi2GetRealStatus, (fmi2StatusKind)below(5), chance(5) ? NULL : &last);
        else if (chance(50)) BARE(fmi3EnterStepMode);
    }
}

static void born(slot *s) {
    const char *const name = chance(95) ? "fuzz" : chance(50) ? "" : NULL, *const token = chance(95) ? GT_TOKEN : chance(50) ? "{}" : NULL;
    s->version = chance(50) ? 2 : 3;
    s->cosimulation = chance(50);
    listen(s);
    s->c = make(s->version, s->cosimulation, name, token, chance(20));
    judge(s, "Instantiate", s->c ? GT_OK : GT_ERROR);
}

static void dead(slot *s) {
    if (!s->c) return;
    forget(s);
    free(s->saved);
    s->saved = NULL;
    release(s->c, s->version);
    s->c = NULL;
}

static void one(slot *s) {
    const unsigned what = below(100);
    if (!s->c) born(s);
    else if (what < 45) onward(s);
    else if (what < 60) values(s, 1);
    else if (what < 73) values(s, 0);
    else if (what < 79) vectors(s);
    else if (what < 83) sensitivities(s);
    else if (what < 86) keep(s);
    else if (what < 88) back(s);
    else if (what < 90) by_bytes(s);
    else if (what < 91) forget(s);
    else if (what < 94) other_types(s);
    else if (what < 95) logging(s);
    else if (what < 99) out_of_order(s);
    else if (chance(30)) dead(s);
}

int main(int count, char **words) {
    unsigned long long calls;
    size_t i;
    if (count != 3) return 2;
    state = strtoull(words[1], NULL, 10);
    calls = strtoull(words[2], NULL, 10);
    while (number < calls) one(slots + below(4));
    for (i = 0; i < 4; i++) dead(slots + i);
    printf("%llu calls, %d lines\n", (unsigned long long)number, all_lines);
    return 0;
}
