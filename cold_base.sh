export PYTHONPYCACHEPREFIX=/work/tmp-E/pyc_base; unset PYTHONDONTWRITEBYTECODE
[ base = base ] && export PYTHONPATH=/work/tmp-E/base_site
rm -rf /work/tmp-E/cc_base; export SYSDYN_CACHE=/work/tmp-E/cc_base
exec /work/venv-wE/bin/python -m sysdyn simulate /work/tmp-E/rc.sd --max-steps 1 -o /work/tmp-E/cw_base.h5
