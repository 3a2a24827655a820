/* What the core needs of the contract between compiled models and the runtime: all of model.h. */
#ifndef SYSDYN_CONTRACT_H
#define SYSDYN_CONTRACT_H

#include "system/model.h"

#endif
