"""A reduced K without a choice by hand: from how an ensemble of plausible cars errs."""
