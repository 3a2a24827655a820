"""What a run writes down beside its unknowns: the energy audit, its ledgers, and what is traced."""
