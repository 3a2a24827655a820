/* What is behind sysdyn_model.h: the tables above, the blocks of residual.c, the core's assembly. */

/* a form with its calls bound to p; what the core counts and where it scratches is this call's own */
static sd_system bound(const sd_system *form, const double *p, sd_call *calls, double *v)
{
    static const int32_t never = 0;
    sd_system system = *form;
    for (int32_t c = 0; c < form->calls; c++) {
        calls[c] = form->call[c];
        calls[c].frame.p = p;
    }
    system.call = calls;
    system.v = v;
    system.stop = &never;
    return system;
}

/* 0 where p may be used with the sizes that are compiled in */
static int refused(const double *p)
{
    for (int32_t k = 0; k < STRUCTURAL; k++)
        if (p[structural[k]] != sd_p0[structural[k]])
            return -1;
    return 0;
}

static int judged(int32_t n, const double *x)
{
    return sd_first_bad(n, x) < 0 ? 0 : 1;
}

#if STATE
/* ---- index form 0: y are the differential unknowns, F(t, y) their slopes from a linear system ----------------------- */

typedef struct {
    sd_system system, matrix, applied;
    sd_call calls[CALLS], silent[CALLS], reduced[CALLS];
    sd_linear *linear;
    sd_underlying *underlying;
    double *memory, *y, *yd, *v;
} slopes;

static void close_slopes(slopes *s)
{
    sd_underlying_free(s->underlying);
    sd_linear_free(s->linear);
    free(s->memory);
}

/* the full layout (y, yd) at a state, everything that follows solved for; close_slopes afterwards */
static int open_slopes(slopes *s, double t, const double *state, const double *p)
{
    const size_t n = FULL;
    memset(s, 0, sizeof *s);
    s->memory = calloc(2 * n + SCRATCH, sizeof(double));
    s->linear = sd_linear_new(matrix_form.n, matrix_form.column, matrix_form.row, matrix_form.order);
    if (!s->memory || !s->linear)
        return -1;
    s->y = s->memory;
    s->yd = s->y + n;
    s->v = s->yd + n;
    s->system = bound(&form, p, s->calls, s->v);
    s->matrix = bound(&form, p, s->silent, s->v);
    for (int32_t c = 0; c < s->matrix.calls; c++)
        if (matrix_form.silent[c])
            s->silent[c].n_dy = 0;
    s->applied = s->system;
    s->applied.call = s->reduced;
    s->applied.calls = 0;
    for (int32_t c = 0; c < s->system.calls; c++)
        if (matrix_form.applied[c])
            s->reduced[s->applied.calls++] = s->calls[c];
    s->underlying = sd_underlying_new(&s->system, s->linear);
    if (!s->underlying)
        return -1;
    s->underlying->matrix = &s->matrix;
    s->underlying->applied = &s->applied;
    s->underlying->direct = matrix_form.direct;
    s->underlying->unknown = matrix_form.unknown;
    s->underlying->rate = matrix_form.rate;
    s->underlying->column = matrix_form.place;
    s->underlying->source = matrix_form.source;
    s->underlying->from_rate = matrix_form.from_rate;
    s->underlying->magnitude = matrix_form.magnitude;
    s->underlying->tolerance = 1e-14;
    memcpy(s->y, full_y, n * sizeof(double));
    memcpy(s->yd, full_yd, n * sizeof(double));
    for (int32_t k = 0; k < sd_n_unknowns; k++)
        s->y[state_place[k]] = state[k];
    int cause = sd_underlying_slopes(s->underlying, t, s->y, s->yd);
    return cause == SD_MEMORY ? -1 : cause ? 1 : 0;
}

int sd_residual(double t, const double *y, const double *yd, const double *p, double *r)
{
    slopes s;
    int code = refused(p);
    if (code)
        return code;
    code = open_slopes(&s, t, y, p);
    for (int32_t k = 0; !code && k < sd_n_unknowns; k++)
        r[k] = yd[k] - s.yd[state_place[k]];
    close_slopes(&s);
    return code ? code : judged(sd_n_unknowns, r);
}

/* values := scale*dF/dy + unit*identity: a column of dF/dy is -A^-1 times the rows' derivatives by that unknown */
static int state_jacobian(double t, const double *y, const double *p, double slope, double unit, double *values)
{
    slopes s;
    const int32_t first = form.kinematics, solved = matrix_form.n;
    double *jy = calloc(2 * (size_t)form.entries + 2 * (size_t)FULL + 2, sizeof(double));
    int code = jy ? open_slopes(&s, t, y, p) : -1;
    if (!jy)
        return -1;
    double *jyd = jy + form.entries + 1, *x = jyd + form.entries + 1, *column = x + FULL;
    if (!code) {
        sd_core_jacobian(&s.system, t, s.y, s.yd, NULL, jy, jyd);
        for (int32_t e = 0; e < matrix_form.entries; e++)
            s.underlying->values[e] = matrix_form.from_rate[e] ? jyd[matrix_form.source[e]] : jy[matrix_form.source[e]];
        code = sd_linear_factor(s.linear, s.underlying->values, NULL) ? 1 : 0;
    }
    for (int32_t k = 0; !code && k < sd_n_unknowns; k++) {
        memset(x, 0, (size_t)solved * sizeof *x);
        memset(column, 0, (size_t)FULL * sizeof *column);
        const int32_t place = state_place[k];
        for (int32_t e = form.column[place]; e < form.column[place + 1]; e++)
            if (form.row[e] >= first)
                x[form.row[e] - first] += jy[e];
        sd_linear_solve(s.linear, x);
        for (int32_t j = 0; j < solved; j++)
            if (matrix_form.rate[j])
                column[matrix_form.unknown[j]] = x[j];
        for (int32_t i = 0; i < form.kinematics; i++)
            column[form.k_q[i]] = form.k_f[i] == place ? -1.0 : 0.0;
        for (int32_t e = sd_colptr[k]; e < sd_colptr[k + 1]; e++)
            values[e] = slope * column[state_place[sd_rowind[e]]] + (sd_rowind[e] == k ? unit : 0.0);
    }
    if (s.memory || s.linear || s.underlying)
        close_slopes(&s);
    free(jy);
    return code ? code : judged(sd_n_entries, values);
}

int sd_jacobian(double t, const double *y, const double *yd, double cj, const double *p, double *values)
{
    (void)yd;
    return refused(p) ? -1 : state_jacobian(t, y, p, 1.0, cj, values);
}

int sd_mass(double t, const double *y, const double *yd, const double *p, double *values)
{
    (void)t, (void)y, (void)yd;
    for (int32_t k = 0; k < sd_n_unknowns; k++)
        for (int32_t e = sd_colptr[k]; e < sd_colptr[k + 1]; e++)
            values[e] = sd_rowind[e] == k;
    return refused(p);
}

#else
/* ---- the descriptor forms -------------------------------------------------------------------------------------------- */

int sd_residual(double t, const double *y, const double *yd, const double *p, double *r)
{
    sd_call calls[CALLS];
    if (refused(p))
        return -1;
    sd_system system = bound(&form, p, calls, NULL);
    sd_core_residual(&system, t, y, yd, r);
    return judged(sd_n_unknowns, r);
}

/* values := dF/dy*one + dF/dyd*other */
static int combined(double t, const double *y, const double *yd, const double *p, int by_y, double cj, double *values)
{
    sd_call calls[CALLS];
    if (refused(p))
        return -1;
    double *jy = malloc((2 * (size_t)form.entries + SCRATCH + 1) * sizeof *jy), *jyd = jy + form.entries;
    if (!jy)
        return -1;
    sd_system system = bound(&form, p, calls, jyd + form.entries);
    sd_core_jacobian(&system, t, y, yd, NULL, jy, jyd);
    for (int32_t e = 0; e < form.entries; e++)
        values[e] = by_y ? jy[e] + cj * jyd[e] : jyd[e];
    free(jy);
    return judged(sd_n_entries, values);
}

int sd_jacobian(double t, const double *y, const double *yd, double cj, const double *p, double *values)
{
    return combined(t, y, yd, p, 1, cj, values);
}

int sd_mass(double t, const double *y, const double *yd, const double *p, double *values)
{
    return combined(t, y, yd, p, 0, 1.0, values);
}
#endif

int sd_outputs(double t, const double *y, const double *yd, const double *p, double *w)
{
    enum { KINETIC = 1, POTENTIAL = 2, MEASURES = 7 }; /* the ledger of energy comes first: kinetic, potential, powers */
    if (refused(p))
        return -1;
#if OBSERVED
    const sd_frame frame = {p, ix, observe_at, observe_to, NULL};
    double *inside = calloc(2 * (size_t)EXTENDED + OBSERVED + AUDITED + MEASURES, sizeof *inside);
    double *rates = inside + EXTENDED, *found = rates + EXTENDED, *meters = found + OBSERVED;
    if (!inside)
        return -1;
#if STATE
    slopes s;
    int code = open_slopes(&s, t, y, p);
    (void)yd;
    if (!code) {
        memcpy(inside, s.y, FULL * sizeof *inside);
        memcpy(rates, s.yd, FULL * sizeof *inside);
    }
    close_slopes(&s);
    if (code) {
        free(inside);
        return code;
    }
#else
    memcpy(inside, y, WRITTEN * sizeof *inside);
    memcpy(rates, yd, WRITTEN * sizeof *inside);
#endif
#if AUDITED
    const sd_frame measured = {p, ix, observe_at, audit_to, NULL};
    sd_audit_rows(&measured, t, inside, rates, meters);
#endif
    for (int k = 0; k < MEASURES; k++)
        if (audit_at[k] >= 0)
            inside[audit_at[k]] = k == KINETIC ? meters[0] : k == POTENTIAL ? meters[1] : NAN;
    sd_observe_rows(&frame, t, inside, rates, found);
    for (int32_t k = 0; k < sd_n_outputs; k++)
        w[k] = found[traced[k]];
    free(inside);
#else
    (void)t, (void)y, (void)yd, (void)w;
#endif
    return 0;
}

/* values of all groups of one kind: into p, into y, or added up in p */
static int groups_of(enum sd_kind kind, double *p, double *y)
{
    for (int32_t g = 0; g < GROUPS; g++) {
        const sd_group *group = &groups[g];
        if (group->kind != kind)
            continue;
        double *v = malloc(((size_t)group->entries + 1) * sizeof *v);
        if (!v)
            return -1;
        const sd_frame frame = {p, following_ix, written_at, written_at, NULL};
        group->values(&frame, sd_t0, y, y, v);
        double *into = kind == SD_INITIAL ? y : p;
        for (int32_t k = 0; kind == SD_CONSTANT && k < group->used; k++)
            into[group->target[k]] = 0.0;
        for (int32_t k = 0; k < group->used; k++) {
            const double value = v[group->source[k]];
            into[group->target[k]] = kind == SD_CONSTANT ? into[group->target[k]] + value : value;
        }
        free(v);
    }
    return 0;
}

int sd_follow(double *p)
{
    double *y = calloc(FOLLOWED + 1, sizeof *y);
    int code = y ? refused(p) : -1;
    if (!code)
        code = groups_of(SD_PARAMETER, p, y);
    if (!code)
        code = refused(p);
    if (!code)
        code = groups_of(SD_INITIAL, p, y);
    if (!code)
        code = groups_of(SD_CONSTANT, p, y);
    free(y);
    return code ? code : judged(sd_n_parameters, p);
}
