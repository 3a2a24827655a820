"""`python -m sysdyn.cli`: the command line where no script is on the path."""

from sysdyn.entry import main

main()
