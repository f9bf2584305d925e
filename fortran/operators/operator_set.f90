!> The elastic operator of a contact with friction and its preconditioners, on vectors, and the work they do.
!>
!> A field with several components is one vector, one component after the other.
!>
!> Equations: docs/theory/discretisation.md, (D4); docs/theory/preconditioner.md.
module hc_operator_set
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_options, only: preconditioner_options_t
  use hc_lattice, only: lattice_t
  use hc_rolling, only: rolling_t
  use hc_field_space, only: field_space_t
  use hc_elastic_medium, only: elastic_medium_t
  use hc_flexibility, only: flexibility_t, normal
  use hc_flexibility_fft, only: fft_flexibility_t, new_fft_flexibility, fft_memory, of_all_tractions, of_tractions_rounded
  use hc_inverse_symbol, only: preconditioner_memory
  use hc_preconditioner, only: preconditioner_t
  use hc_symbol_preconditioner, only: pressure_preconditioner_t, new_symbol_preconditioner
  use hc_shear_preconditioner, only: shear_preconditioner_t, new_shear_preconditioner
  use hc_spectrum_cache, only: kernel_cache_t
  use hc_linear_system, only: linear_system_t
  implicit none
  private

  public :: operators_t, new_operators, operators_memory, traction_system_t

  !> Operator and preconditioners over one window, and the work they did: any that extend the abstract types.
  type :: operators_t
    class(flexibility_t), allocatable :: flexibility
    !> Preconditioners of the pressure and of the shear traction
    class(preconditioner_t), allocatable :: normal, tangential
    !> Space of the fields
    type(field_space_t) :: space
    !> Work of the preconditioners, in applications of the full operator
    real(wp) :: preconditioning = 0.0_wp
    !> Steady rolling: tangential displacements are those over a spacing, u less u at the node ahead
    type(rolling_t) :: rolling
  contains
    !> Displacements that given components of the traction cause along others
    procedure :: apply => apply_operators
    !> The same along components that act, in the place of the tractions
    procedure :: replace => replace_by_displacement
    !> Count the work from here on; no nodes are active
    procedure :: reset
    !> Free what the preconditioners store for the active nodes
    procedure :: clear
    !> All work so far, in applications of the full operator
    procedure :: work
  end type operators_t

  !> A linear system of tractions, whose vectors are components over the window.
  type, abstract, extends(linear_system_t) :: traction_system_t
    type(operators_t), pointer :: operators => null()
  contains
    procedure :: take_image
  end type traction_system_t

contains

  !> Set up the operator by FFT and preconditioners by the inverse symbol, over a window.
  subroutine new_operators(self, lattice, medium, space, error, cache, options, rounded)
    !> Operators to be set up
    type(operators_t), intent(out) :: self
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> The two bodies
    class(elastic_medium_t), intent(in) :: medium
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error
    !> Cache of spectra
    type(kernel_cache_t), pointer, intent(in), optional :: cache
    !> Tuning numbers of the preconditioners; absent: the usual ones
    type(preconditioner_options_t), intent(in), optional :: options
    !> The operator only serves for starts, with spectra in single precision; absent: it does not
    logical, intent(in), optional :: rounded
    type(preconditioner_options_t) :: tuning
    integer :: kind
    type(fft_flexibility_t), allocatable :: flexibility
    type(pressure_preconditioner_t), allocatable :: normal
    type(shear_preconditioner_t), allocatable :: tangential

    if (present(options)) tuning = options
    self%space = space
    allocate (flexibility, normal, tangential)
    kind = of_all_tractions
    if (present(rounded)) kind = merge(of_tractions_rounded, of_all_tractions, rounded)
    call new_fft_flexibility(flexibility, lattice, medium, error, kind, space, cache=cache)
    if (allocated(error)) return
    call new_symbol_preconditioner(normal, lattice, medium, space, tuning, error, cache)
    if (allocated(error)) return
    call new_shear_preconditioner(tangential, lattice, medium, space, tuning, error, cache)
    if (allocated(error)) return
    call move_alloc(flexibility, self%flexibility)
    call move_alloc(normal, self%normal)
    call move_alloc(tangential, self%tangential)
  end subroutine new_operators

  !> Count the bytes that operator and preconditioners take, for a window of the given size.
  pure integer(selected_int_kind(18)) function operators_memory(extent, threads, n_spectrum, shared, periodic)
    !> Number of columns and rows of the window
    integer, intent(in) :: extent(2)
    !> Threads to use
    integer, intent(in) :: threads
    !> Number of spectra of the two bodies
    integer, intent(in) :: n_spectrum
    !> Row transforms share the memory of those of a finer lattice; the window repeats
    logical, intent(in) :: shared, periodic

    ! spectra that only serve for starts are rounded
    operators_memory = fft_memory(extent, .false., threads, n_spectrum, shared, periodic)/merge(2, 1, shared) &
                       + preconditioner_memory(extent, threads, .false., shared=.true.) &
                       + preconditioner_memory(extent, threads, .true., shared=.true.)
  end function operators_memory

  !> Multiply some components, given as vectors.
  subroutine apply_operators(self, from, traction, onto, displacement, error)
    class(operators_t), intent(inout) :: self
    !> Components that act: normal, along_x, along_y
    integer, intent(in) :: from(:)
    !> Their values, one after the other [Pa]
    real(wp), intent(in), contiguous, target :: traction(:)
    !> Components that are wanted
    integer, intent(in) :: onto(:)
    !> Their values, one after the other [m]
    real(wp), intent(out), contiguous, target :: displacement(:)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp), pointer, contiguous :: acting(:, :, :), wanted(:, :, :)

    associate (n => self%space%own_extent(self%flexibility%lattice%extent))
      acting(1:n(1), 1:n(2), 1:size(from)) => traction
      wanted(1:n(1), 1:n(2), 1:size(onto)) => displacement
    end associate
    call self%flexibility%apply(from, acting, onto, wanted, error)
    if (.not. allocated(error)) call take_off_ahead(self, onto, displacement)
  end subroutine apply_operators

  !> Take tangential displacements at the node ahead off those of each node, in steady rolling.
  subroutine take_off_ahead(self, components, displacement)
    class(operators_t), intent(in) :: self
    integer, intent(in) :: components(:)
    !> One component after the other [m]
    real(wp), intent(inout), contiguous, target :: displacement(:)
    integer :: m, n

    if (.not. self%rolling%steady) return
    n = product(self%space%own_extent(self%flexibility%lattice%extent))
    do m = 1, size(components)
      if (components(m) == normal) cycle
      call self%rolling%subtract_ahead(self%flexibility%lattice%extent(1), displacement((m - 1)*n + 1:m*n))
    end do
  end subroutine take_off_ahead

  !> Replace tractions, given as vectors, by the displacements along the same components.
  subroutine replace_by_displacement(self, components, values, error)
    class(operators_t), intent(inout) :: self
    !> Components: normal, along_x, along_y
    integer, intent(in) :: components(:)
    !> Their tractions [Pa], then the displacements [m], one component after the other
    real(wp), intent(inout), contiguous, target :: values(:)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp), pointer, contiguous :: fields(:, :, :)

    associate (n => self%space%own_extent(self%flexibility%lattice%extent))
      fields(1:n(1), 1:n(2), 1:size(components)) => values
    end associate
    call self%flexibility%replace(components, fields, error)
    if (.not. allocated(error)) call take_off_ahead(self, components, values)
  end subroutine replace_by_displacement

  !> Point to memory for components as vectors: that of the operator, until its next use or that of a preconditioner, or that of the
  !> caller.
  subroutine take_image(self, n, own, image, stat)
    class(traction_system_t), intent(in) :: self
    integer, intent(in) :: n
    real(wp), allocatable, target, intent(inout) :: own(:)
    real(wp), pointer, contiguous, intent(out) :: image(:)
    integer, intent(out) :: stat

    stat = 0
    associate (flexibility => self%operators%flexibility)
      image => flexibility%in_place(n/product(self%space%own_extent(flexibility%lattice%extent)))
    end associate
    if (associated(image)) return
    if (.not. allocated(own)) allocate (own(n), stat=stat)
    if (stat == 0) image => own
  end subroutine take_image

  !> Return all work so far, in applications of the full operator.
  pure real(wp) function work(self)
    class(operators_t), intent(in) :: self
    work = self%flexibility%applications + self%preconditioning
  end function work

  !> Reset the count of work; no nodes are active.
  subroutine reset(self)
    class(operators_t), intent(inout) :: self

    self%flexibility%applications = 0.0_wp
    self%preconditioning = 0.0_wp
    call self%clear()
  end subroutine reset

  !> Free the arrays of the preconditioners for the active nodes.
  subroutine clear(self)
    class(operators_t), intent(inout) :: self

    call self%normal%clear()
    call self%tangential%clear()
  end subroutine clear

end module hc_operator_set
