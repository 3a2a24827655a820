"""`python -m sysdyn`."""

from sysdyn.entry import main

main()
