/* Saved states: a null pointer, what the block is, a checksum, and the plain numbers of the instance. */

typedef struct {
    void *nothing; /* clients that free the first word of a saved state find nothing there */
    uint64_t model, check;
    uint64_t size;
    gt_state state;
} gt_saved;

#if GT_DELAYS
#define GT_SAVED_SIZE (sizeof(gt_saved) + sizeof(gt_memory)) /* what delays look back at stands behind */
#else
#define GT_SAVED_SIZE sizeof(gt_saved)
#endif

/* Fowler, Noll and Vo's hash 1a, 64 bits. */
static uint64_t gt_hash(const void *start, size_t size) {
    const unsigned char *bytes = start;
    uint64_t hash = UINT64_C(14695981039346656037);
    size_t i;
    for (i = 0; i < size; i++) hash = (hash ^ bytes[i]) * UINT64_C(1099511628211);
    return hash;
}

static size_t gt_state_size(const gt_instance *it) {
    (void)it;
    return GT_SAVED_SIZE;
}

static void gt_save(const gt_instance *it, void *block) {
    gt_saved *saved = block;
    memset(saved, 0, sizeof *saved);
    saved->model = gt_hash(GT_TOKEN, sizeof GT_TOKEN);
    saved->size = GT_SAVED_SIZE;
    memcpy(&saved->state, &it->now, sizeof it->now);
    saved->state.mode = it->mode;
    saved->state.cosimulation = it->cosimulation;
    saved->check = gt_hash(&saved->state, sizeof saved->state);
#if GT_DELAYS
    memcpy(saved + 1, &it->memory, sizeof it->memory);
    saved->check ^= gt_hash(saved + 1, sizeof it->memory);
#endif
}

static gt_status gt_restore(gt_instance *it, const char *function, const void *block, size_t size) {
    gt_saved saved;
    uint64_t check;
    if (size != GT_SAVED_SIZE)
        return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: found a saved state of %lu bytes, expected %lu; it belongs to another model or is "
                      "incomplete", function, (unsigned long)size, (unsigned long)GT_SAVED_SIZE);
    memcpy(&saved, block, sizeof saved);
    if (saved.nothing || saved.size != GT_SAVED_SIZE || saved.model != gt_hash(GT_TOKEN, sizeof GT_TOKEN))
        return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: the saved state belongs to another model or is damaged; nothing was changed", function);
    check = gt_hash(&saved.state, sizeof saved.state);
#if GT_DELAYS
    check ^= gt_hash((const char *)block + sizeof saved, sizeof it->memory);
#endif
    if (saved.check != check)
        return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: the checksum of the saved state does not fit, it is damaged; nothing was changed",
                      function);
    if (saved.state.cosimulation != it->cosimulation)
        return gt_say(it, GT_ERROR, GT_LOG_ERROR, "%s: the saved state is that of an instance for %s, expected one for %s; nothing was "
                      "changed", function, it->cosimulation ? "Model Exchange" : "Co-Simulation",
                      it->cosimulation ? "Co-Simulation" : "Model Exchange");
    memcpy(&it->now, &saved.state, sizeof it->now);
#if GT_DELAYS
    memcpy(&it->memory, (const char *)block + sizeof saved, sizeof it->memory);
#endif
    it->mode = (gt_mode)it->now.mode;
    it->time = it->now.time;
    it->outputs_stale = 1;
    it->parameters_stale = 1;
    gt_parameters(it); /* not left for later: a refresh would solve again, and end a rounding error away */
    return GT_OK;
}
