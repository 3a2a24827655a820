"""`python -m sysdyn`."""

from sysdyn.cli.main import main

main()
