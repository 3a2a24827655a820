"""The stepping core: plain C11, built once as an extension module."""
