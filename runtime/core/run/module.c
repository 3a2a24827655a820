/* The Python module whose file is the core's library, loaded with ctypes (see ../model/core_library.py); its one function
 * is asked some hundred times a run, and ctypes' own ways take five times as long. */
#include <Python.h>

#include "linear/dense/graded.h"
#include "linear/tuning.h"
#include "run/events/fits.h"
#include "run/many/many.h"
#include "start/search.h"
#include "system/settle.h"
#include "steppers/bdf/bdf.h"
#include "steppers/energy/energy.h"
#include "steppers/explicit/dopri.h"
#include "steppers/radau/radau.h"
#include "steppers/rosenbrock/rosenbrock.h"

#ifdef __GLIBC__
#include <malloc.h>
#endif

#define OWN_PAGES (1 << 20) /* bytes */
#define OWNERS 65536        /* arrays at most: glibc's own bound */

/* Hands memory that was let go back to the machine: between the stages of a large run little of it would fit.  huge: from
 * now on arrays have pages of their own, which go back as they do; between others they would leave gaps. */
void sd_trim(int huge)
{
#ifdef __GLIBC__
    if (huge) {
        mallopt(M_MMAP_MAX, OWNERS); /* a command had said none */
        mallopt(M_MMAP_THRESHOLD, OWN_PAGES);
    }
    malloc_trim(0);
#endif
}

/* address of the first element of an array, whatever its strides; the caller keeps it alive */
static PyObject *address(PyObject *module, PyObject *array)
{
    (void)module;
    Py_buffer view;
    if (PyObject_GetBuffer(array, &view, PyBUF_STRIDES))
        return NULL;
    PyObject *found = PyLong_FromVoidPtr(view.buf);
    PyBuffer_Release(&view);
    return found;
}

static PyMethodDef functions[] = {
    {"address", address, METH_O, "Address of an array's first element; the caller keeps the array alive."},
    {NULL, NULL, 0, NULL},
};

/* the layout of structures and arrays, and codes of kinds, which Python reads here */
static const struct {
    const char *name;
    int value;
} layout[] = {
    {"SD_CONTRACT", SD_CONTRACT},
    {"SD_NODES", SD_NODES},
    {"SD_PAST", SD_PAST},
    {"SD_MANY_COUNTERS", SD_MANY_COUNTERS},
    {"SD_MANY_ROWS", SD_MANY_ROWS},
    {"SD_ROW_HEAD", SD_ROW_HEAD},
    {"SD_TRACE", SD_TRACE},
    {"SD_SAMPLE", SD_SAMPLE},
    {"SD_COMPARED", SD_COMPARED},
    {"SD_RELAXING", SD_RELAXING},
    {"SD_PARTS", SD_PARTS},
    {"SD_JUMP", SD_JUMP},
    {"SD_BRANCH_SLIDES", SD_BRANCH_SLIDES},
    {"SD_BRANCH_RESTS", SD_BRANCH_RESTS},
    {"SD_AUDIT_HEAD", SD_AUDIT_HEAD},
    {"SD_LEDGER_ROWS", SD_LEDGER_ROWS},
    {"SD_LARGEST", SD_LARGEST},
    {"SD_CAPPED", SD_CAPPED},
    {"SD_DIFFERS", SD_DIFFERS},
    {"SD_MISSED", SD_MISSED},
    {"SD_LEFT_OUT", SD_LEFT_OUT},
    {"SD_ITERATIONS", SD_ITERATIONS},
    {"SD_HALVINGS", SD_HALVINGS},
    {"SD_LOST", SD_LOST},
    {"SD_FOLDS", SD_FOLDS},
    {"SD_MAX_ORDER", SD_MAX_ORDER},
    {"SD_ENERGY_STAGES", SD_ENERGY_STAGES},
    {"SD_DOPRI_ALL", SD_DOPRI_ALL},
    {"SD_DOPRI_DENSE", SD_DOPRI_DENSE},
    {"SD_STAGES", SD_STAGES},
    {"SD_PAIRS", SD_PAIRS},
    {"SD_POINTS", SD_POINTS},
    {"SD_UNPULLED", SD_UNPULLED},
    {"SD_ROSENBROCK_STAGES", SD_ROSENBROCK_STAGES},
    {"SD_ROSENBROCK_DENSE", SD_ROSENBROCK_DENSE},
};

/* thresholds that both sides share (runtime/tuning.py) */
static const struct {
    const char *name;
    double value;
} level[] = {
    {"SD_BY_SUMS", SD_BY_SUMS},
    {"SD_BY_FACTORS", SD_BY_FACTORS},
    {"SD_CANCELS", SD_CANCELS},
    {"SD_DEPENDENT", SD_DEPENDENT},
    {"SD_MET", SD_MET},
    {"SD_SAME", SD_SAME},
    {"SD_INSTANT", SD_INSTANT},
    {"SD_HALF_OF_ITS_DIGITS", SD_HALF_OF_ITS_DIGITS},
    {"SD_OPEN", SD_OPEN},
    {"SD_UNSEEN", SD_UNSEEN},
    {"SD_SLIGHT", SD_SLIGHT},
    {"SD_SMALL", SD_SMALL},
    {"SD_PIVOT", SD_PIVOT},
    {"SD_GENERIC", SD_GENERIC},
    {"SD_GRANTED", SD_GRANTED},
    {"SD_EVALUATION", SD_EVALUATION},
    {"SD_EACH", SD_EACH},
    {"ROUNDING", ROUNDING},
    {"FALLEN", FALLEN},
};

static struct PyModuleDef definition = {PyModuleDef_HEAD_INIT, "_core", NULL, -1, functions, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__core(void)
{
    PyObject *module = PyModule_Create(&definition);
    for (size_t i = 0; module != NULL && i < sizeof layout / sizeof *layout; i++)
        if (PyModule_AddIntConstant(module, layout[i].name, layout[i].value))
            Py_CLEAR(module);
    for (size_t i = 0; module != NULL && i < sizeof level / sizeof *level; i++)
        if (PyModule_AddObject(module, level[i].name, PyFloat_FromDouble(level[i].value)))
            Py_CLEAR(module);
    return module;
}
