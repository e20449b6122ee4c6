//! A truth simulation for the blind proof. Shares no equation code with the models that kort fits; only 'kort prove' and tests may use it.
