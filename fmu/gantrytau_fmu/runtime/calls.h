/* What the layers of FMI 2 and FMI 3 share: one component, and its calls with all that is checked before them.
 *
 * A call that is refused (out of order, wrong arguments) returns an error, tells why, and changes nothing.
 * A call that failed on the way (a step, an initialisation, an event) leaves the component in failed mode, where
 * values may be read and only a reset, a saved state, or the end of its life lead out. */
#ifndef GT_CALLS_H
#define GT_CALLS_H

#include "core.h"
#include "fmi2_types.h"
#include "fmi3_types.h"

#if defined _WIN32 || defined __CYGWIN__
#define GT_EXPORT __declspec(dllexport)
#elif defined __GNUC__
#define GT_EXPORT __attribute__((visibility("default")))
#else
#define GT_EXPORT
#endif

enum { GT_EXCHANGE = 1, GT_COSIMULATION = 2, GT_BOTH = 3 }; /* kinds of instances, as bits */
enum { /* sets of modes */
    GT_ALIVE = GT_INITIALIZATION | GT_EVENT | GT_CONTINUOUS | GT_STEP,
    GT_READABLE = GT_ALIVE | GT_TERMINATED | GT_FAILED,
    GT_SETTABLE = GT_ALIVE | GT_INSTANTIATED,
    GT_ALWAYS = GT_READABLE | GT_INSTANTIATED
};

/* What an fmi2Component and an fmi3Instance point to. */
typedef struct {
    int version;  /* 2 or 3: functions of the other version refuse it */
    gt_instance *it;
    char *name;
    void *environment;
    fmi2CallbackLogger logger;              /* version 2, or NULL */
    fmi3LogMessageCallback log_message;     /* version 3, or NULL */
    unsigned char told[GT_LOG_CATEGORIES];  /* which categories are wanted */
    gt_status stepped;                      /* how the last step went */
} gt_component;

#endif
