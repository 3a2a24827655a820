"""The language server: `sysdyn lsp`."""
