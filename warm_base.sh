export PYTHONPYCACHEPREFIX=/work/tmp-E/pyc_base; unset PYTHONDONTWRITEBYTECODE
[ base = base ] && export PYTHONPATH=/work/tmp-E/base_site
export SYSDYN_CACHE=/work/tmp-E/cc_base
exec /work/venv-wE/bin/python -m sysdyn simulate /work/tmp-E/rc.sd  -o /work/tmp-E/cw_base.h5
