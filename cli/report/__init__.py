"""`sysdyn report`: one page about a model under a scene, a file for each of its sections."""
