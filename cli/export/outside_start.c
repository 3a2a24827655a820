/* ---- a consistent start: the nearest to the guesses, on all rows that hold there ---------------------------------------
 *
 * Gauss-Newton in u = weight (x - guess)/scale: each step is the u of least norm of the linearised rows A u = A u_k - r, by
 * Householder's factors of A^T with columns pivoted, redundant rows left out (Golub & Van Loan, section 5.5).  What that
 * leaves of rows whose terms are small beside all of u goes by the least change from where it ended. */

#if START
enum { ITERATIONS_OF_START = 60, HALVINGS_OF_START = 12 };
static const double held = 1e-9, settled = 2e-15, rank_of_start = 1e-11, noise_of_start = 1e-13;

typedef struct {
    sd_system system;
    sd_call calls[START_CALLS];
    double *y, *yd, *r, *jy, *jyd, *v;   /* of the full layout and its pattern */
    double *x, *trial, *guess, *before, *ended; /* [START_X] */
    const double *from;                  /* [START_X] what steps are least from */
    double *a, *b, *u, *size, *norm;     /* the linearised rows */
    int32_t *row_of, *order;             /* [rows] place among the rows in use, or -1; order of elimination */
    int32_t *column_of;                  /* [START_X] */
    double *memory;
    int32_t *places;
} seeking;

static int open_seeking(seeking *s, const double *p)
{
    const size_t x = START_X, rows = (size_t)start_form.rows, entries = (size_t)start_form.entries;
    memset(s, 0, sizeof *s);
    s->memory = calloc(2 * (size_t)START_FULL + 4 * rows + 2 * entries + START_SCRATCH + 7 * x + rows * x + 8, sizeof(double));
    s->places = calloc(2 * rows + x + 1, sizeof(int32_t));
    if (!s->memory || !s->places)
        return -1;
    s->y = s->memory, s->yd = s->y + START_FULL, s->r = s->yd + START_FULL, s->b = s->r + rows;
    s->size = s->b + rows, s->norm = s->size + rows, s->jy = s->norm + rows, s->jyd = s->jy + entries;
    s->v = s->jyd + entries, s->x = s->v + START_SCRATCH, s->trial = s->x + x, s->guess = s->trial + x;
    s->before = s->guess + x, s->ended = s->before + x, s->u = s->ended + x, s->a = s->u + 2 * x;
    s->row_of = s->places, s->order = s->row_of + rows, s->column_of = s->order + rows;
    s->system = bound(&start_form, p, s->calls, s->v);
    return 0;
}

static void expand(seeking *s, const double *x)
{
    memcpy(s->y, x, START_UNKNOWNS * sizeof *x);
    memset(s->yd, 0, START_FULL * sizeof *x);
    for (int32_t k = 0; k < START_RATES; k++)
        s->yd[start_rate[k]] = x[START_UNKNOWNS + k];
    for (int32_t i = 0; i < START_KINEMATICS; i++)
        s->yd[start_k_q[i]] = s->y[start_k_f[i]];
}

static void start_rows(seeking *s, const double *x)
{
    expand(s, x);
    sd_core_residual(&s->system, sd_t0, s->y, s->yd, s->r);
}

/* one entry of the linearised rows, in scaled unknowns */
static void enter(seeking *s, int32_t row, int32_t place, double value, int sizes)
{
    const int32_t i = s->row_of[row], j = s->column_of[place];
    if (i < 0 || j < 0 || !isfinite(value))
        return;
    if (sizes)
        s->size[i] += fabs(value) * start_scale[place];
    else
        s->a[(size_t)i * START_X + j] += value * start_scale[place] / start_weight[place];
}

static void enter_all(seeking *s, int sizes)
{
    for (int32_t c = 0; c < START_UNKNOWNS; c++)
        for (int32_t e = start_form.column[c]; e < start_form.column[c + 1]; e++) {
            enter(s, start_form.row[e], c, s->jy[e], sizes);
            if (start_rate_place[c] >= 0)
                enter(s, start_form.row[e], start_rate_place[c], s->jyd[e], sizes);
        }
}

/* largest row in use, each in the size of its terms; s->r holds the rows */
static double largest(const seeking *s, const sd_trial *trial)
{
    double most = 0.0;
    for (int32_t k = 0; k < trial->rows; k++) {
        const double value = fabs(s->r[trial->row[k]]) / (s->size[k] > 0.0 ? s->size[k] : 1.0);
        most = isfinite(value) ? fmax(most, value) : INFINITY;
    }
    return most;
}

/* s->a: rows of equal norm as columns of length n; s->u := the least u with a^T u = b */
static void least_norm(seeking *s, int32_t m, int32_t n)
{
    double first = 0.0;
    int32_t rank = 0;
    for (int32_t i = 0; i < m; i++) {
        double *row = s->a + (size_t)i * START_X, sum = 0.0;
        for (int32_t j = 0; j < n; j++)
            sum += row[j] * row[j];
        sum = sum > 0.0 ? sqrt(sum) : 1.0;
        for (int32_t j = 0; j < n; j++)
            row[j] /= sum;
        s->b[i] /= sum;
        s->order[i] = i;
    }
    double *tau = s->u + START_X;
    for (int32_t k = 0; k < m && k < n; k++) {
        int32_t best = k;
        double most = -1.0;
        for (int32_t i = k; i < m; i++) {
            const double *row = s->a + (size_t)s->order[i] * START_X;
            double sum = 0.0;
            for (int32_t j = k; j < n; j++)
                sum += row[j] * row[j];
            if (sum > most)
                most = sum, best = i;
        }
        most = sqrt(most);
        first = k ? first : most;
        if (!(most > rank_of_start * first))
            break;
        const int32_t chosen = s->order[best];
        s->order[best] = s->order[k];
        s->order[k] = chosen;
        double *pivot = s->a + (size_t)chosen * START_X;
        const double alpha = pivot[k] > 0.0 ? -most : most;
        tau[k] = (alpha - pivot[k]) / alpha;
        for (int32_t j = k + 1; j < n; j++)
            pivot[j] /= pivot[k] - alpha;
        pivot[k] = alpha;
        for (int32_t i = k + 1; i < m; i++) {
            double *row = s->a + (size_t)s->order[i] * START_X, sum = row[k];
            for (int32_t j = k + 1; j < n; j++)
                sum += pivot[j] * row[j];
            sum *= tau[k];
            row[k] -= sum;
            for (int32_t j = k + 1; j < n; j++)
                row[j] -= sum * pivot[j];
        }
        rank++;
    }
    memset(s->u, 0, (size_t)n * sizeof *s->u);
    for (int32_t k = 0; k < rank; k++) {
        const double *row = s->a + (size_t)s->order[k] * START_X;
        double sum = s->b[s->order[k]];
        for (int32_t j = 0; j < k; j++)
            sum -= row[j] * s->u[j];
        s->u[k] = sum / row[k];
    }
    for (int32_t k = rank - 1; k >= 0; k--) {
        const double *pivot = s->a + (size_t)s->order[k] * START_X;
        double sum = s->u[k];
        for (int32_t j = k + 1; j < n; j++)
            sum += pivot[j] * s->u[j];
        sum *= tau[k];
        s->u[k] -= sum;
        for (int32_t j = k + 1; j < n; j++)
            s->u[j] -= sum * pivot[j];
    }
}

/* one step towards the rows from s->x, in s->trial; the largest row there was */
static double step_of(seeking *s, const sd_trial *trial)
{
    memset(s->a, 0, (size_t)trial->rows * START_X * sizeof *s->a);
    memset(s->size, 0, (size_t)trial->rows * sizeof *s->size);
    start_rows(s, s->x);
    sd_core_jacobian(&s->system, sd_t0, s->y, s->yd, NULL, s->jy, s->jyd);
    enter_all(s, 1);
    enter_all(s, 0);
    for (int32_t i = 0; i < trial->rows; i++) {
        double sum = -s->r[trial->row[i]];
        const double *row = s->a + (size_t)i * START_X;
        for (int32_t j = 0; j < trial->free; j++) {
            const int32_t place = trial->place[j];
            sum += row[j] * (s->x[place] - s->from[place]) * start_weight[place] / start_scale[place];
        }
        s->b[i] = sum;
    }
    const double now = largest(s, trial);
    least_norm(s, trial->rows, trial->free);
    memcpy(s->trial, s->x, START_X * sizeof *s->x);
    for (int32_t j = 0; j < trial->free; j++) {
        const int32_t place = trial->place[j];
        s->trial[place] = s->from[place] + s->u[j] * start_scale[place] / start_weight[place];
    }
    return now;
}

/* 0 where the rows of a trial hold at s->x afterwards; else s->x is what it was */
static int attempt(seeking *s, const sd_trial *trial)
{
    for (int32_t k = 0; k < start_form.rows; k++)
        s->row_of[k] = -1;
    for (int32_t k = 0; k < START_X; k++)
        s->column_of[k] = -1;
    for (int32_t k = 0; k < trial->rows; k++)
        s->row_of[trial->row[k]] = k;
    for (int32_t k = 0; k < trial->free; k++)
        s->column_of[trial->place[k]] = k;
    memcpy(s->before, s->x, START_X * sizeof *s->x);
    s->from = s->guess;
    double now = INFINITY, reached = INFINITY;
    for (int m = 0; m < ITERATIONS_OF_START; m++) {
        now = step_of(s, trial);
        if (now <= settled && m > 0)
            break;
        double part = 1.0;
        for (int h = 0; h < HALVINGS_OF_START; h++, part *= 0.5) {
            if (h)
                for (int32_t k = 0; k < START_X; k++)
                    s->trial[k] = s->x[k] + 0.5 * (s->trial[k] - s->x[k]);
            start_rows(s, s->trial);
            reached = largest(s, trial);
            if (reached < now || (m == 0 && isfinite(reached) && now < held))
                break;
        }
        if (!(reached < now) && (m > 0 || now >= held || !isfinite(reached))) { /* no nearer */
            if (s->from != s->guess)
                break;
            memcpy(s->ended, s->x, START_X * sizeof *s->x);
            s->from = s->ended;
            continue;
        }
        memcpy(s->x, s->trial, START_X * sizeof *s->x);
        now = reached;
    }
    if (now < held)
        return 0;
    memcpy(s->x, s->before, START_X * sizeof *s->x);
    return 1;
}

/* x: given values by the formulas; what follows begins where it was for the parameters that were bound */
static int seek(seeking *s, double *p)
{
    double *given = s->trial;
    memset(given, 0, START_UNKNOWNS * sizeof *given);
    if (groups_of(SD_INITIAL, p, given))
        return -1;
    memcpy(s->x, start_known, START_X * sizeof *s->x);
    memcpy(s->guess, given, START_UNKNOWNS * sizeof *given);
    for (int32_t k = 0; k < START_INITIAL; k++)
        s->x[start_initial[k]] = given[start_initial[k]];
    for (int32_t k = 0; k < START_STAGES; k++) {
        const sd_stage *stage = &start_stage[k];
        int code = 1;
        for (int32_t i = 0; code && i < stage->trials; i++)
            code = attempt(s, &stage->trial[i]);
        if (code && k == START_STAGES - 1)
            return 1;
        if (!code && stage->guess)
            memcpy(s->guess, s->x, START_X * sizeof *s->x);
    }
    for (int32_t k = START_UNKNOWNS; k < START_UNKNOWNS + START_RATES; k++)
        if (fabs(s->x[k]) <= noise_of_start * start_scale[k])
            s->x[k] = 0.0; /* round-off beside its magnitude: rows whose slopes underflow leave a rate open */
    expand(s, s->x);
    return 0;
}
#endif

int sd_start(const double *p, double *y, double *yd)
{
    if (refused(p))
        return -1;
    if (!memcmp(p, sd_p0, (size_t)sd_n_parameters * sizeof *p)) {
        memcpy(y, sd_y0, (size_t)sd_n_unknowns * sizeof *y);
        memcpy(yd, sd_yd0, (size_t)sd_n_unknowns * sizeof *yd);
        return 0;
    }
#if START
    seeking s;
    double *own = malloc(((size_t)sd_n_parameters + 1) * sizeof *own); /* formulas read parameters alone */
    int code = own ? open_seeking(&s, p) : -1;
    if (!own)
        return -1;
    memcpy(own, p, (size_t)sd_n_parameters * sizeof *own);
    code = code ? code : seek(&s, own);
    for (int32_t k = 0; !code && k < sd_n_unknowns; k++) {
#if STATE
        y[k] = s.y[state_place[k]];
#else
        y[k] = k < WRITTEN ? s.y[k] : 0.0;
        yd[k] = k < WRITTEN ? s.yd[k] : 0.0;
#endif
    }
#if STATE
    slopes at;
    int opened = !code;
    code = code ? code : open_slopes(&at, sd_t0, y, p);
    for (int32_t k = 0; !code && k < sd_n_unknowns; k++)
        yd[k] = at.yd[state_place[k]];
    if (opened)
        close_slopes(&at);
#endif
    free(s.memory);
    free(s.places);
    free(own);
    return code;
#else
    return -1; /* too large to be started anew outside: compile it with these parameters */
#endif
}
