/* Values by reference. */

static const char *gt_name(unsigned reference) {
    return gt_variable_names[reference];
}

static gt_status gt_known_reference(gt_instance *it, unsigned reference) {
    if (reference < GT_VARIABLES) return GT_OK;
    return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: found the value reference %u, expected one below %u; take references from the model "
                  "description of this FMU", GT_NAME, reference, (unsigned)GT_VARIABLES);
}

static void gt_start_values(gt_instance *it) {
    double x[GT_ROOM(GT_STATES) + GT_ROOM(GT_STEPPING)];
    int i;
    if (!it->now.starts_stale) return;
    it->now.starts_stale = 0;
    gt_parameters(it);
    gt_starts(it->a, x, it->w);
    for (i = 0; i < GT_STATES; i++)
        if (!it->now.given[i]) it->now.x[i] = x[i];
    memcpy(it->now.u + GT_INPUTS, x + GT_STATES, GT_STEPPING * sizeof(double));
}

static gt_status gt_get_outputs(gt_instance *it) {
    gt_status status = gt_refresh(it);
    if (status != GT_OK || !it->outputs_stale) return status;
    gt_outputs(it->a, it->y, it->w);
    it->outputs_stale = 0;
    return GT_OK;
}

static gt_status gt_get(gt_instance *it, unsigned reference, double *value) {
    const gt_variable *variable;
    gt_status status = gt_known_reference(it, reference);
    if (status != GT_OK) return status;
    variable = gt_variables + reference;
    if (it->mode == GT_INITIALIZATION || it->mode == GT_INSTANTIATED) gt_start_values(it);
    switch ((gt_kind)variable->kind) {
    case GT_TIME: *value = it->now.time; break;
    case GT_CONSTANT: *value = gt_constants[variable->index]; break;
    case GT_PARAMETER: *value = it->now.p[variable->index]; break;
    case GT_INPUT: case GT_HELD: *value = it->now.u[variable->index]; break;
    case GT_STATE:
        if (variable->fixed) status = gt_present(it);
        *value = it->now.x[variable->index];
        break;
    case GT_DERIVATIVE: {
        double rates[GT_ROOM(GT_STATES)];
        status = gt_get_rates(it, rates);
        if (status == GT_OK) *value = rates[variable->index];
        break;
    }
    case GT_OUTPUT:
        status = gt_present(it);
        if (status == GT_OK) status = gt_get_outputs(it);
        if (status == GT_OK) {
            *value = it->y[variable->index];
            if (!isfinite(*value))
                status = gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: %s is not a finite number at time = %.9g s; the model has no solution "
                                "there (a pose out of reach or singular): keep away from it", GT_NAME, gt_name(reference), it->now.time);
        }
        break;
    case GT_INDICATOR: {
        double indicators[GT_ROOM(GT_INDICATORS)] = {0};
        status = gt_get_indicators(it, indicators);
        if (status == GT_OK) *value = indicators[variable->index];
        break;
    }
    case GT_MODE:
        status = gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: %s is an integer, expected a floating-point variable", GT_NAME, gt_name(reference));
    }
    return status;
}

static gt_status gt_get_integer(gt_instance *it, unsigned reference, int *value) {
    const gt_status status = gt_known_reference(it, reference);
    if (status != GT_OK) return status;
    if (gt_variables[reference].kind != GT_MODE)
        return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: %s is a floating-point variable, expected an integer", GT_NAME, gt_name(reference));
    *value = (int)it->now.m[gt_variables[reference].index];
    return GT_OK;
}

static void gt_refuse(gt_instance *it, unsigned reference, const char *why) {
    gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: %s cannot be set: %s", GT_NAME, gt_name(reference), why);
}

/* Where a value goes that may be set now; NULL with a log line if it may not. */
static double *gt_place(gt_instance *it, unsigned reference, double value) {
    const int early = it->mode == GT_INSTANTIATED || it->mode == GT_INITIALIZATION;
    const gt_variable *variable;
    const char *why = "it is calculated";
    if (gt_known_reference(it, reference) != GT_OK) return NULL;
    variable = gt_variables + reference;
    switch ((gt_kind)variable->kind) {
    case GT_PARAMETER: why = variable->fixed && !early ? "it is a fixed parameter; set it before initialisation ends" : NULL; break;
    case GT_INPUT: why = NULL; break;
    case GT_STATE:
        why = !early && it->cosimulation
                  ? "it is a state, which can be set before initialisation ends; to go back, restore a saved state"
                  : early && variable->fixed ? "it follows from initial equations; set what they depend on" : NULL;
        break;
    case GT_CONSTANT: why = "it shapes the equations and is constant; keep it as a parameter by naming it in given= of export_fmu"; break;
    case GT_TIME: why = "it is the independent variable"; break;
    default: break;
    }
    if (!isfinite(value)) why = "found NaN or an infinite value, expected a finite number";
    if (why) {
        gt_refuse(it, reference, why);
        return NULL;
    }
    return (variable->kind == GT_PARAMETER ? it->now.p : variable->kind == GT_INPUT ? it->now.u : it->now.x) + variable->index;
}

static gt_status gt_set(gt_instance *it, unsigned reference, double value) {
    double *place = gt_place(it, reference, value);
    const gt_variable *variable;
    if (!place) return GT_ERROR;
    variable = gt_variables + reference;
    if (variable->kind == GT_STATE && (it->mode == GT_INSTANTIATED || it->mode == GT_INITIALIZATION)) it->now.given[variable->index] = 1;
    if (*place == value) return GT_OK;
    *place = value;
    if (variable->kind == GT_PARAMETER) {
        it->parameters_stale = 1;
        if (variable->fixed) it->now.starts_stale = 1;
    }
    it->now.stale = it->outputs_stale = 1;
    return GT_OK;
}

#define GT_BEYOND 1e-6 /* of a limit or value, as in `simulate`: less is rounding, or the give of an end stop */

static void gt_tell_limits(gt_instance *it) {
    int i;
    for (i = 0; i < GT_LIMITS; i++) {
        const gt_limit *limit = gt_limits + i;
        const gt_variable *variable = gt_variables + limit->reference;
        double value, end, room;
        if (it->beyond[i] || (variable->kind == GT_OUTPUT && gt_get_outputs(it) != GT_OK)) continue;
        value = (variable->kind == GT_OUTPUT ? it->y : variable->kind == GT_STATE ? it->now.x
                 : variable->kind == GT_PARAMETER ? it->now.p : it->now.u)[variable->index];
        end = value < limit->min ? limit->min : limit->max;
        room = GT_BEYOND * fmax(fmax(fabs(end), fabs(value)), 1e-3 * limit->size);
        if (!(limit->min - value > room || value - limit->max > room)) continue;
        it->beyond[i] = 1;
        gt_say(it, GT_WARNING, GT_LOG_WARNING, "%s: %s passes its %s of %.6g%s and is %.6g%s at time = %.9g s, %.3g beyond; "
               "this is told once", GT_NAME, gt_name(limit->reference), value < limit->min ? "min" : "max", end,
               gt_limit_units[i], value, gt_limit_units[i], it->now.time, fabs(value - end));
    }
}
