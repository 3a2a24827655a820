/* The Python module whose file is the core's library, loaded with ctypes (see ../model/core_library.py); its one function
 * is asked some hundred times a run, and ctypes' own ways take five times as long. */
#include <Python.h>

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

static struct PyModuleDef definition = {PyModuleDef_HEAD_INIT, "_core", NULL, -1, functions, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__core(void)
{
    return PyModule_Create(&definition);
}
